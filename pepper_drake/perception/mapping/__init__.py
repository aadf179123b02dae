"""Obstacles: depth images to clouds, voxel map, moving obstacles."""
