"""The part that the robot's own motion has in its nearness to an obstacle.

What comes to a robot that stands, or that goes away from it, comes no less for a robot that stops
for good: who waits can go on when it has left, and who withdraws should. A stop helps where the
robot itself goes nearer. So speed and separation are judged of what moves by itself (compare the
speed and separation monitoring of ISO/TS 15066:2016, 5.5.4).
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
