"""Inverse kinematics, joint limits and checks of commands."""
