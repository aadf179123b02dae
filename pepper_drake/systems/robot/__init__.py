"""LeafSystems for joints, base and safety."""
