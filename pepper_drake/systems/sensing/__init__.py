"""LeafSystems of cameras, goal, cloud and gaze."""
