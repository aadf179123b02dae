"""Dynamic movement primitives: transformation systems, couplings, rollouts, files."""
