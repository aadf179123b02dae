"""Head angles: aiming and view planning."""
