"""Obstacles: point clouds from depth images, voxel map, moving obstacles."""
