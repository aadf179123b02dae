"""The scene in which a simulated robot is calibrated: only a marker on its hand."""

import numpy as np

from pepper_drake.models.scene import GoalObject, HandMarker, Scene

_MISPLACED, _TILTED = 0.003, 0.03
"""Largest errors of a marker placed by hand: in each coordinate [m], about each axis [rad]."""
_REMOTE_GOAL = [-3.0, 0.0, 0.0]


def calibration_scene(arm: str, marker: HandMarker, seed: int) -> Scene:
    """Returns the scene, with the marker placed on the hand with random errors.

    Args:
        arm: "left" or "right".
        marker: The marker at its nominal pose on the hand.
        seed: Seed of the errors.
    """
    rng = np.random.default_rng((seed, 0x4D))
    position = np.array(marker.position) + rng.uniform(-_MISPLACED, _MISPLACED, 3)
    rpy = np.array(marker.rpy) + rng.uniform(-_TILTED, _TILTED, 3)
    scene = Scene(
        name="calibration",
        description="A marker on the hand, and nothing around.",
        arm=arm,
        goal=GoalObject(position=list(_REMOTE_GOAL)),
        hand_marker=HandMarker(marker.id, marker.size, position.tolist(), rpy.tolist()),
    )
    scene.check()
    return scene
