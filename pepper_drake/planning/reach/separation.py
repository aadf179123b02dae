"""Speed limit of the arm before space not seen recently, in narrow places, near new obstacles.

Speed and separation monitoring (ISO/TS 15066:2016, 5.5.4) requires the separation distance

    S_p = S_h + S_r + S_s + C + Z_d + Z_r,

the distance that a person covers until the robot stands, the robot's reaction and braking
distances, and uncertainties. Here the hazard is a place on the arm's path that an obstacle may have
entered since it was seen. S_h, C and Z are accounted for by the age up to which a place counts as
seen (`UnseenSpaceParams.recent`). What remains is that the arm must be able to stop before such a
place. The time t to it at the movement's full speed allows the fraction `speed` of that speed with

    t = speed * reaction + speed² / (2 slowing).

An obstacle that appeared since the arm started may be larger than its visible part, and may move.
From it the arm keeps the separation distance itself: at a speed v of its fastest point

    S_p = v_h (T_r + T_s) + v T_r + v T_s / 2 + C,   T_s = v / a.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt


@dataclass
class SeparationParams:
    """Parameters of slowing down before space not seen recently, and near new obstacles."""

    reaction: float = 0.25
    """Time until the arm begins to slow down [s]: the age of an image, 0.1 s, the supervisor's
    period, 0.05 s, and half the time between images, 0.1 s."""
    slowing: float = 4.0
    """Rate of change of the speed fraction [1/s]: the arm stops from full speed within 0.25 s,
    which at 1.5 rad/s is 6 rad/s² of the 10 that its joints may have."""
    touch_speed: float = 0.04
    """Speed of the arm's fastest point in unseen space, and where its clearance is less than
    `clearance.slow` [m/s]: a contact may have 0.05 m/s."""
    approach_speed: float = 0.3
    """Speed v_h of a new obstacle [m/s]: the fastest in the scenes. That of a walking person,
    1.6 m/s in the technical specification, would stop the arm anywhere near."""
    deceleration: float = 2.0
    """Deceleration a of the arm's fastest point [m/s²]: 0.5 m/s within the 0.25 s of `slowing`."""
    intrusion: float = 0.03
    """Distance by which a new obstacle may extend beyond its visible part, C and Z [m]."""
    min_speed_fraction: float = 0.02
    """Least fraction of a movement's speed: above zero, so that the movement ends."""


class StaleSpace(NamedTuple):
    """Space that the arm sweeps soon and that was not seen recently.

    Attributes:
        place: Its centre (3,) in W [m]; NaN if there is none.
        time: Time until the arm enters it at the movement's full speed [s].
        fastest: Speed of the arm's fastest point until then, or soon, at full speed [m/s].
        distance: Distance of the arm to an obstacle that appeared since it started [m].
    """

    place: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    time: float = np.inf
    fastest: float = 0.0
    distance: float = np.inf


def separated_speed(distance: float, params: SeparationParams) -> float:
    """Returns the speed limit of the arm's points at a distance [m] from a new obstacle [m/s]."""
    if not np.isfinite(distance):
        return np.inf
    v_h, r, a = params.approach_speed, params.reaction, params.deceleration
    room = max(distance - params.intrusion - v_h * r, 0.0)
    # v² / (2 a) + v (r + v_h / a) = room
    linear = r + v_h / a
    return float(a * (np.sqrt(linear**2 + 2.0 * room / a) - linear))


def escapes(
    times: npt.NDArray[np.float64],
    distances: npt.NDArray[np.float64],
    soon: float,
    params: SeparationParams,
) -> bool:
    """True if a movement leaves a new obstacle soon, or before it can have come near.

    Args:
        times: Times (N,) along the rest of the movement, from 0 [s].
        distances: Distances (N,) of the arm to the obstacle as it is now [m].
        soon: Time within which the distance has to grow [s].
        params: Speed and extent of the obstacle.
    """
    within = distances[times <= soon]
    if within[-1] > within[0]:
        return True
    leaves = distances > distances[0]
    until = int(np.argmax(leaves)) if leaves.any() else len(leaves)
    approached = distances[:until] - params.approach_speed * times[:until]
    return bool(approached.min() > params.intrusion)


def speed_fraction(stale: StaleSpace, params: SeparationParams) -> float:
    """Returns the allowed fraction of the movement's speed, from 0 to 1."""
    share, fastest = 1.0, max(stale.fastest, 1e-9)
    if np.isfinite(stale.time):
        k, r = params.slowing, params.reaction
        share = k * (np.sqrt(r**2 + 2.0 * max(stale.time, 0.0) / k) - r)
    share = min(share, separated_speed(stale.distance, params) / fastest)
    gentle = params.touch_speed / fastest
    return float(min(max(share, gentle, params.min_speed_fraction), 1.0))


def changed_speed(speed: float, wanted: float, duration: float, params: SeparationParams) -> float:
    """Returns the speed fraction a duration [s] after `wanted` was set."""
    most = params.slowing * duration
    return float(speed + np.clip(wanted - speed, -most, most))
