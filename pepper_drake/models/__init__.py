"""Pepper, objects, markers and scenes, and the functions that add them to a plant."""
