"""State of the reach's supervision."""

from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachCommand, ReachMode
from pepper_drake.planning.reach.reach_plan import ReachPlan
from pepper_drake.planning.reach.separation import StaleSpace
from pepper_drake.planning.reach.steadiness import Steadiness
from pepper_drake.short_repr import short_repr

RESTS = (ReachMode.IDLE, ReachMode.DONE, ReachMode.FAILED)
"""Modes in which nothing is decided."""


class Effect(Enum):
    """Effect of a computation when it is over."""

    BRAKE = "brake"
    """The arm brakes, within its acceleration limits, and stays."""
    PLACEMENT = "placement"
    """The base drives to where the plan has it, or the reach is refused."""
    CHECK = "check"
    """The plan is what the arm will do from where the base stands, or another place is sought."""
    START = "start"
    """The arm starts."""
    MOVEMENT = "movement"
    """The arm goes over to the plan."""


@dataclass(frozen=True, eq=False)
class Pending:
    """The result of a computation that is not over yet in simulated time.

    Attributes:
        due: When it takes effect [s].
        effect: What it does then.
        plan: The plan that it gives, if any.
        observation: What the plan was made from, if it is to be remembered.
        suspended_plan: For a retreat, the plan that is taken up again later.
    """

    due: float
    effect: Effect
    plan: ReachPlan | None = None
    observation: Observation | None = None
    suspended_plan: ReachPlan | None = None


@dataclass(frozen=True, eq=False)
class ReachState:
    """The supervisor's state; each change makes a new one.

    Nothing in it depends on how fast the computer is: plans take effect `PlanningLatency` after
    what they were made from.

    Attributes:
        mode: What the robot is doing.
        since: When the mode or the present movement began [s].
        goal_seen_since: When the goal was first seen [s]; NaN before.
        base_pose_wanted: Where the base should stand, x, y, yaw in W [m, rad]; NaN to stay.
        reason: Name of the outcome: "" while all is well.
        message: The same as a sentence.
        still_since: Since when the hand has been at the goal [s]; NaN when it is not.
        places: Base placements chosen so far.
        placement: The last base placement, with the movement that was found for it. While the
            robot looks for the goal: one whose drive passes space that was not seen yet.
        plan: What is performed, or will be; None before it is decided.
        movements: Movements begun so far: more than one after replanning.
        braking: Whether the arm brakes or stands, and the base too, until there is a plan or a
            depth image again.
        cloud_time: Of the last cloud that the rest of the movement was checked against [s].
        checked: When the reach was last planned from where the robot stands, or a detour was last
            sought in vain [s].
        planned_with: The observation that the movement was planned with.
        started_with: The observation that the first movement was planned with.
        hanging: (N, 3) points near the goal of things that hung in the air then, in W [m].
        waits_with: The observation with which the arm retreated or last sought a detour.
        suspended_plan: While the arm has retreated: the plan that is taken up again later.
        arrived: When the base last arrived where it was sent [s].
        started: When the arm first started [s].
        speed: The share of its speed at which the movement is performed.
        performed: Time of the movement that is over, at its full speed [s].
        stale: Space ahead that was not seen lately, its time as that of the movement.
        slowed: Time that slowing down has cost, in all movements [s].
        waited: Time for which it waited for obstacles to leave, in all [s].
        blind: Time for which the arm waited because depth images did not come [s].
        may_drive: Whether the base may be sent to another place.
        look_at: Place in W that was not seen, or not lately, and that the arm is going to pass [m];
            NaN for none.
        steadiness: Of what is measured, since the arm started.
        pending: Results of computations that have no effect yet.
    """

    __repr__ = short_repr

    mode: ReachMode = ReachMode.LOOKING
    since: float = 0.0
    goal_seen_since: float = np.nan
    base_pose_wanted: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    reason: str = ""
    message: str = ""
    still_since: float = np.nan
    places: int = 0
    placement: ReachPlan | None = None
    plan: ReachPlan | None = None
    movements: int = 0
    braking: bool = False
    cloud_time: float = np.nan
    checked: float = np.nan
    planned_with: Observation | None = None
    started_with: Observation | None = None
    hanging: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    waits_with: Observation | None = None
    suspended_plan: ReachPlan | None = None
    arrived: float = np.nan
    started: float = np.nan
    speed: float = 1.0
    performed: float = 0.0
    stale: StaleSpace = field(default_factory=StaleSpace)
    slowed: float = 0.0
    waited: float = 0.0
    blind: float = 0.0
    may_drive: bool = True
    look_at: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    steadiness: Steadiness = field(default_factory=Steadiness)
    pending: tuple[Pending, ...] = ()

    @property
    def movement(self) -> Movement | None:
        """The plan's movement, whether it is performed yet or not."""
        return None if self.plan is None else self.plan.movement

    @property
    def active_movement(self) -> int:
        """The number of the movement that is performed; 0 for none."""
        return self.movements if self.has_started and not self.braking else 0

    @property
    def performed_origin(self) -> Origin:
        """Origin of the movement that is performed."""
        if not self.active_movement:
            return Origin.NONE
        return Origin.TAUGHT if self.movement is None else self.movement.origin

    @property
    def has_started(self) -> bool:
        """True if the arm reaches, or has reached its goal."""
        return self.mode in (ReachMode.REACHING, ReachMode.HOLDING, ReachMode.DONE)

    @property
    def base_goal(self) -> tuple[float, float, float]:
        """Goal of the base, x, y, yaw in W [m, rad]; NaN for "brake and stay"."""
        stays = self.mode == ReachMode.FAILED or (self.braking and self.mode == ReachMode.DRIVING)
        return (np.nan, np.nan, np.nan) if stays else self.base_pose_wanted

    @property
    def is_planning(self) -> bool:
        """True while a plan is being computed."""
        return any(one.effect != Effect.BRAKE for one in self.pending)

    @property
    def will_brake(self) -> bool:
        """True if the arm brakes, or is about to."""
        return self.braking or any(one.effect == Effect.BRAKE for one in self.pending)

    def __deepcopy__(self, memo: dict) -> "ReachState":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self

    def after(self, duration: float) -> "ReachState":
        """Returns the state with so much more of the movement performed, if there is one [s]."""
        if not self.active_movement:
            return self
        moved = self.speed * duration
        return replace(
            self, performed=self.performed + moved, slowed=self.slowed + duration - moved
        )

    def to(self, mode: ReachMode, time: float) -> "ReachState":
        """Returns the state in another mode from now on."""
        return replace(self, mode=mode, since=time, still_since=np.nan)

    def later(self, pending: Pending) -> "ReachState":
        """Returns the state with one more pending result."""
        return replace(self, pending=(*self.pending, pending))

    def with_plan(
        self, plan: ReachPlan, time: float, suspended_plan: ReachPlan | None = None
    ) -> "ReachState":
        """Returns the state of an arm that goes over to another plan."""
        retreats_on = None not in (suspended_plan, self.suspended_plan)
        return replace(
            self,
            plan=plan,
            movements=self.movements + 1,
            since=time,
            still_since=np.nan,
            speed=1.0,
            performed=0.0,
            stale=self.stale if retreats_on else StaleSpace(),
            braking=False,
            suspended_plan=suspended_plan,
            pending=(),
        )

    def fail(self, time: float, reason: str, message: str) -> "ReachState":
        """Returns the final state of a failure, named by a word and a sentence; the base stays."""
        nowhere = (np.nan, np.nan, np.nan)
        return replace(
            self.to(ReachMode.FAILED, time),
            reason=reason,
            message=message,
            base_pose_wanted=nowhere,
            look_at=nowhere,
            pending=(),
        )


def obey(state: ReachState, command: ReachCommand, time: float) -> ReachState:
    """Returns the state after a person's command; one that is obeyed already changes nothing.

    Args:
        state: Before.
        command: What is wanted.
        time: Now [s].
    """
    if command == ReachCommand.IDLE:
        idle = state.mode == ReachMode.IDLE
        return state if idle else ReachState(mode=ReachMode.IDLE, since=time)
    if command == ReachCommand.STOP:
        is_over = state.mode in RESTS
        return state if is_over else state.fail(time, "stopped", "the reach was stopped")
    if state.mode != ReachMode.IDLE:
        return state
    if command == ReachCommand.MOVE:
        return ReachState(ReachMode.SETTLING, since=time, arrived=time, may_drive=False)
    return ReachState(since=time)
