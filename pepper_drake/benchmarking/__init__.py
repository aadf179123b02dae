"""Many reaches with several methods, side by side: what reached, what touched, how fast."""
