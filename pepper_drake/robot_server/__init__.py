"""A simulated Pepper that speaks NAOqi: client programs use its address like a robot's."""
