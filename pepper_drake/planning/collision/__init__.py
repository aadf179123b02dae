"""Distances of the arm to obstacles, to the goal object and to the robot itself."""
