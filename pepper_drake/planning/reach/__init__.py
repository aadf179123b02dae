"""The reach: planning scene, simulation, planner, base placement, supervision."""
