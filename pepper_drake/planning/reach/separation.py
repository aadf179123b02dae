"""The speed at which the arm may go on towards space that was not seen lately.

Speed and separation monitoring (ISO/TS 15066:2016, 5.5.4) asks for the distance

    S_p = S_h + S_r + S_s + C + Z_d + Z_r,

the distance that a person covers until the robot stands, those that the robot covers until it
brakes and while it brakes, and uncertainties. Here the hazard is a place on the arm's path that an
obstacle may have entered since it was seen. S_h, C and the Z are in the age up to which a place
counts as seen (`UnseenSpaceParams.recent`). It remains that the arm has to stand before such a
place, with

    t = speed * reaction + speed² / (2 slowing),

the time to that place along the movement at its full speed, and `speed` the share of it.

To an obstacle that appeared since the arm started, which may be larger than what is seen of it and
may move, the arm keeps the distance itself: at a speed v of its fastest point

    S_p = v_h (T_r + T_s) + v T_r + v T_s / 2 + C,   T_s = v / a.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


@dataclass
class SeparationParams:
    """Slowing down before space that was not seen lately."""

    reaction: float = 0.25
    """Time until the arm begins to slow down [s]: the age of an image, 0.1 s, the supervisor's
    period, 0.05 s, and half the time between images, 0.1 s."""
    slowing: float = 4.0
    """Change of the share of the movement's speed [1/s]: from full speed the arm stands after
    0.25 s, which at 1.5 rad/s is 6 rad/s² of the 10 that its joints may have."""
    touch_speed: float = 0.04
    """Speed of the arm's fastest point with which it goes on where it cannot see [m/s]: a touch
    may have 0.05 m/s."""
    approach_speed: float = 0.3
    """Speed v_h of a new obstacle [m/s]: the scenes' fastest. A walking person's, 1.6 m/s in the
    technical specification, would not let the arm move anywhere near."""
    deceleration: float = 2.0
    """Deceleration a of the arm's fastest point [m/s²]: 0.5 m/s within the 0.25 s of `slowing`."""
    intrusion: float = 0.03
    """Distance by which a new obstacle may reach beyond what is seen of it, C and Z [m]."""
    slowest: float = 0.02
    """Least share of a movement's speed: above zero, so that it gets to its end."""


class StaleSpace(NamedTuple):
    """Space that the arm passes soon and that was not seen lately.

    Attributes:
        place: Its middle (3,) in W [m]; NaN if there is none.
        time: Until the arm gets there at its movement's full speed [s].
        fastest: Speed of the arm's fastest point on the way, at that speed [m/s].
        distance: Of the arm to an obstacle that appeared since it started [m].
    """

    place: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    time: float = np.inf
    fastest: float = 0.0
    distance: float = np.inf


def separated_speed(distance: float, params: SeparationParams) -> float:
    """Returns the speed that the arm's points may have at a distance from a new obstacle [m/s]."""
    if not np.isfinite(distance):
        return np.inf
    v_h, r, a = params.approach_speed, params.reaction, params.deceleration
    room = max(distance - params.intrusion - v_h * r, 0.0)
    # v² / (2 a) + v (r + v_h / a) = room
    linear = r + v_h / a
    return float(a * (np.sqrt(linear**2 + 2.0 * room / a) - linear))


def speed_share(stale: StaleSpace, params: SeparationParams) -> float:
    """Returns the share of the movement's speed with which the arm may go on, from 0 to 1."""
    share, fastest = 1.0, max(stale.fastest, 1e-9)
    if np.isfinite(stale.time):
        k, r = params.slowing, params.reaction
        share = k * (np.sqrt(r**2 + 2.0 * max(stale.time, 0.0) / k) - r)
    share = min(share, separated_speed(stale.distance, params) / fastest)
    gentle = params.touch_speed / fastest
    return float(min(max(share, gentle, params.slowest), 1.0))


def changed_speed(speed: float, wanted: float, duration: float, params: SeparationParams) -> float:
    """Returns the share of the speed some time [s] after another one was wanted."""
    most = params.slowing * duration
    return float(speed + np.clip(wanted - speed, -most, most))
