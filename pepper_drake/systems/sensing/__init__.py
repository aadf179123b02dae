"""LeafSystems for cameras, goal, cloud and gaze."""
