"""A real Pepper, or one that is served, driven over NAOqi by the same diagrams as the simulated."""
