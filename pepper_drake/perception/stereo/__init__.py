"""Stereo matching and segmentation."""
