"""Pepper's hands: one motor each opens and closes all fingers.

A hand's opening runs from 0, closed, to 1, open, as for NAOqi's joints RHand and LHand. In the
plant the fingers are not separate bodies: 28 phalanges of a few grams would only slow the
simulation down. The wrist's shapes cover the hand up to half open, `RELAXED`, and tasks never move
the arm with a hand more open than that: the fingers of an open one protrude by 24 mm. The opening
itself is simulated outside the plant, by `HandMotors`.
"""

import math
from dataclasses import dataclass

from pepper_drake.naoqi.constants import HANDS

CLOSED, RELAXED, OPEN = 0.0, 0.5, 1.0

HAND_SPEED = 1.5
"""Rate at which a hand opens and closes, full strokes per second [1/s]; assumed."""

FINGER_RADIUS = 0.007
"""Radius of the fingers [m]."""

FINGER_RANGE = 0.872665
"""Change of the angle between two phalanges from closed to open [rad]."""

_BEND = -math.pi / 3
_TIP = 0.014
"""Length of each finger's last phalanx [m]: makes the open hand as long as ROS' meshes."""


def hand_joint(arm: str) -> str:
    """Returns the name of an arm's hand joint ("right" or "left"), one of NAOqi's `HANDS`."""
    return HANDS[("left", "right").index(arm)]


@dataclass(frozen=True)
class Phalanx:
    """One link of a finger, on a joint about its own z that mimics the hand's joint.

    Attributes:
        joint: Name of its joint. It sorts after the hand's, which RoboPlan and Pinocchio need
            before the joints that mimic it.
        link: Its name, as in ROS.
        parent: Name of its parent link.
        xyz: Position of the joint in the parent's frame [m].
        rpy: Its orientation there with the hand closed [rad].
        length: From the joint to the next, or to the finger's tip, along x [m].
    """

    joint: str
    link: str
    parent: str
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    length: float


# Joints of the first phalanges on the wrist, from ROS' description of Pepper 1.0.
_RIGHT_ROOTS = {
    "Finger1": ((0.0821, 0.0268, 0.004), (1.39757, 1.04064, 0.0334335)),
    "Finger2": ((0.0873, 0.0073, 0.006), (1.5708, 1.0472, 0.061086)),
    "Finger3": ((0.0833, -0.0123, 0.004), (1.67523, 1.04483, 0.029316)),
    "Finger4": ((0.074, -0.0309, 0.0), (1.74402, 1.04064, -0.0683394)),
    "Thumb": ((0.0482, 0.0357, -0.0199), (-1.18323, 0.60626, -0.533978)),
}
_LEFT_ROOTS = {
    "Finger1": ((0.0821, -0.0268, 0.004), (1.74402, 1.04064, -0.0334335)),
    "Finger2": ((0.0873, -0.0073, 0.006), (1.5708, 1.0472, -0.061086)),
    "Finger3": ((0.0833, 0.0123, 0.004), (1.46636, 1.04483, -0.029314)),
    "Finger4": ((0.074, 0.0309, 0.0), (1.39757, 1.04064, 0.0683394)),
    "Thumb": ((0.0482, -0.0357, -0.0199), (-1.95836, 0.60626, 0.533978)),
}


def phalanges(hand: str) -> tuple[Phalanx, ...]:
    """Returns the 14 links of a hand's fingers, each after its parent.

    Args:
        hand: "LHand" or "RHand".
    """
    side = hand[0]
    found = []
    for finger, (xyz, rpy) in (_LEFT_ROOTS if side == "L" else _RIGHT_ROOTS).items():
        count, length = (2, 0.022) if finger == "Thumb" else (3, 0.018)
        parent = f"{side.lower()}_wrist"
        for number in range(1, count + 1):
            joint, link = f"{hand}{finger}{number}", f"{side}{finger}{number}_link"
            reach = length if number < count else _TIP
            found.append(Phalanx(joint, link, parent, xyz, rpy, reach))
            parent, xyz, rpy = link, (length, 0.0, 0.0), (0.0, 0.0, _BEND)
    return tuple(found)
