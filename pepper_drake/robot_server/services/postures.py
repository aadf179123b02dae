"""NAOqi's postures of Pepper."""

from pepper_drake.models.pepper import POSTURES
from pepper_drake.naoqi.constants import HANDS, JOINTS

_HAND = 0.6


def _posture(name: str) -> dict[str, float]:
    known = POSTURES[name] | dict.fromkeys(HANDS, _HAND)
    return {joint: known.get(joint, 0.0) for joint in JOINTS}


NAOQI_POSTURES: dict[str, dict[str, float]] = {
    "Crouch": _posture("crouch"),
    "Stand": _posture("stand"),
    # The maker publishes no angles of StandInit: its picture shows Stand with a straight body.
    "StandInit": _posture("upright"),
    "StandZero": dict.fromkeys(JOINTS, 0.0),
}
"""Angle by joint [rad]; those of StandZero are clipped to the joints' limits."""

POSTURE_FAMILIES: dict[str, str] = {
    "Crouch": "Crouching",
    "Stand": "Standing",
    "StandInit": "Standing",
    "StandZero": "Standing",
}
