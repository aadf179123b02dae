"""LeafSystems that guide the hand and record its motion."""
