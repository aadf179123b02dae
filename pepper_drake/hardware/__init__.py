"""A real Pepper, or a served one, driven over NAOqi by the same diagrams as the simulated one."""
