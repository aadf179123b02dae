"""A simulated Pepper that speaks NAOqi: any client program takes its address for a robot."""
