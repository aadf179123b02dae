"""The scene in which a simulated robot is calibrated: nothing but a marker on its hand."""

import numpy as np

from pepper_drake.models.scene import GoalObject, HandMarker, Scene

_MISPLACED, _TILTED = 0.003, 0.03
"""A person puts the marker so well on the hand: in each coordinate [m], about each axis [rad]."""
_OUT_OF_THE_WAY = [-3.0, 0.0, 0.0]


def calibration_scene(arm: str, marker: HandMarker, seed: int) -> Scene:
    """Returns the scene, with the marker as a person puts it on the hand.

    Args:
        arm: "left" or "right".
        marker: As it should be on the hand.
        seed: Of how far off it is put.
    """
    rng = np.random.default_rng((seed, 0x4D))
    position = np.array(marker.position) + rng.uniform(-_MISPLACED, _MISPLACED, 3)
    rpy = np.array(marker.rpy) + rng.uniform(-_TILTED, _TILTED, 3)
    scene = Scene(
        name="calibration",
        description="A marker on the hand, and nothing around.",
        arm=arm,
        goal=GoalObject(position=list(_OUT_OF_THE_WAY)),
        hand_marker=HandMarker(marker.id, marker.size, position.tolist(), rpy.tolist()),
    )
    scene.check()
    return scene
