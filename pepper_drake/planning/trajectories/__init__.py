"""Joint trajectories: cost, search, adaptation, retreat."""
