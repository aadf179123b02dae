"""Camera models, sensor noise, image files and asynchronous images."""
