"""Clearance that is lost by the robot's own motion, and not by an obstacle's.

A protective stop helps only if the robot itself moves towards the obstacle. An obstacle that
approaches a robot at rest, or one that retreats, is not kept away by a stop: the robot waits until
it has left, or goes on retreating. (Compare the speed and separation monitoring of
ISO/TS 15066:2016, 5.5.4.)
"""


def own_approach_clearance(before: float, after: float, duration: float, slowest: float) -> float:
    """Clearance that the robot's own motion leads to; infinite where it takes none away [m].

    Args:
        before: Clearance to the obstacles of now at the robot's earlier posture [m].
        after: The same at its later posture [m].
        duration: Time between the two [s].
        slowest: A robot that approaches more slowly stands, as far as noise and slack let that be
            told [m/s].

    Returns:
        The later clearance, also where one of the two is NaN: not known is no reason to go on.
    """
    if before - after <= slowest * duration or before == after:
        return float("inf")
    return after
