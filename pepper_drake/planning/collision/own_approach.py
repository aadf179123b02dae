"""Clearance lost by the robot's own motion rather than an obstacle's.

A protective stop helps only if the robot itself moves towards the obstacle. It does not keep an
obstacle away from a robot at rest or in retreat: the robot waits until the obstacle has left, or
continues its retreat. (Compare the speed and separation monitoring of ISO/TS 15066:2016, 5.5.4.)
"""


def own_approach_clearance(before: float, after: float, duration: float, slowest: float) -> float:
    """Returns the clearance that the robot's own motion leads to; infinite if it loses none [m].

    Args:
        before: Clearance to the present obstacles at the robot's earlier posture [m].
        after: The same at its later posture [m].
        duration: Time between the two [s].
        slowest: Approach speed below which the robot counts as at rest, given noise and backlash
            [m/s].

    Returns:
        The later clearance, also if one of the two is NaN: unknown does not count as safe.
    """
    if before - after <= slowest * duration or before == after:
        return float("inf")
    return after
