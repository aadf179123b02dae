"""LeafSystems that lead the hand and record it."""
