"""Images to geometry, as plain functions: cameras, markers, goal, clouds, memory, stereo."""
