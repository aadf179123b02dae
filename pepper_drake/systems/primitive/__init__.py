"""LeafSystems of the movement primitive."""
