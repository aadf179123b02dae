"""Camera models, their noise, and images that are still being rendered."""
