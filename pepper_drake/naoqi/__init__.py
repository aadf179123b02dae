"""NAOqi's conventions as plain functions and data: names, images, clocks and streamed commands."""
