"""LeafSystems of joints, base and safety."""
