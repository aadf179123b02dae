"""What the reach planner is asked for, and what it answers."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.reach.movement import Movement

Vector = npt.NDArray[np.float64]


class PlanStatus(StrEnum):
    """What playing the reach through says of it."""

    CLEAR = "clear"
    OUT_OF_REACH = "out_of_reach"
    NO_CLEAR_PATH = "no_clear_path"
    CANNOT_FOLLOW = "cannot_follow"
    SELF_COLLISION = "self_collision"
    NO_STANDING_ROOM = "no_standing_room"


@dataclass
class ReachPlannerParams:
    """What counts as a good reach, m and rad."""

    hand_x: float = 0.26
    """Where the hand's goal should be in the torso frame, ahead, if the demonstration's own end is
    not a place that the arm can reach (because it was recorded in another frame)."""
    hand_y: float = 0.20
    """The same to the arm's side."""
    reach: float = 0.39
    """Farthest distance of the hand from the shoulder."""
    slack: float = 0.08
    """How far the goal may move away and should still be within reach, if that can be had."""
    body_clearance: float = 0.02
    """Between the body (all but the reaching arm) and the cloud."""
    wanted_clearance: float = 0.016
    """Between the arm and the cloud: with this a place to stand is taken at once."""
    least_clearance: float = 0.006
    """With less the arm does not start."""
    object_clearance: float = 0.001
    """Between an adapted movement and the goal object."""
    far_allowance: float = 0.008
    """How much less is enough to drive up to a place: from near the same is seen better, and is
    checked again before the arm starts."""
    withdrawal_clearance: float = 0.06
    """Where the arm waits for what came in its way to go."""
    position_tolerance: float = 0.006
    """Of the hand at the end of the motion played through."""
    following_error: float = 0.12
    """Farthest distance of the hand to the primitive's path on the way."""
    self_clearance: float = -0.012
    """Between the arm's spheres and the body (see `SelfClearance`)."""
    solid_depth: float = 0.03
    """How far what is seen is taken to reach down, for clearances."""
    settle: float = 0.4
    """How long the motion played through goes on after its end, in tau."""
    places_with_slack: int = 3
    """How many places with slack are played through at most."""
    places_tried: int = 8
    """How many others, at most."""
    adapt: bool = True
    """Whether a movement that would not pass is adapted to the scene, as a whole arm; needs a
    `BarrierCoupling`."""
    collision_checked: bool = True
    """Whether what the coupling makes of the movement is judged before the arm starts and held
    against what is seen on its way. If not, a reach is judged, and a place to stand chosen, as if
    there were no coupling, and no link that comes too close stops the arm: so the authors of some
    couplings have it."""
    slowest: float = 1.6
    """How many times as long as the one that was shown a movement may take and be liked."""
    places_adapted: int = 4
    """How many places to stand are adapted to at most."""
    places_searched: int = 40
    """Among how many the easiest are looked for, where none of the usual ones will do."""


@dataclass(frozen=True, eq=False)
class ReachPlan:
    """A reach, played through.

    Attributes:
        verdict: Whether the robot may do it.
        sentence: Why not.
        base_pose: (3,) where the base stands, x, y, yaw in W.
        position_error: Of the hand at the end [m].
        clearance: Least distance of the arm to the cloud [m].
        joint_path: (N, 5) the arm's joints, rad, every 10 ms.
        movement: What is to be performed.
        collision_checked: Whether the path is held against what is seen.
    """

    status: PlanStatus
    message: str
    base_pose: Vector
    position_error: float = np.inf
    clearance: float = -np.inf
    joint_path: Vector | None = None
    movement: Movement | None = None
    collision_checked: bool = True


def quality(plan: ReachPlan, wanted_clearance: float) -> tuple[bool, bool, float, float]:
    """Order of plans: clear ones, those that get there, the most room wanted, the quickest."""
    arrives = plan.status in (PlanStatus.CLEAR, PlanStatus.NO_CLEAR_PATH)
    return (
        plan.status == PlanStatus.CLEAR,
        arrives,
        min(plan.clearance, wanted_clearance) if arrives else -plan.position_error,
        -plan.movement.primitive.duration if plan.movement is not None else -np.inf,
    )
