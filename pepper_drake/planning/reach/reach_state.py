"""State of the reach supervision."""

from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachCommand, ReachMode
from pepper_drake.planning.reach.reach_plan import ReachPlan, nearest_index
from pepper_drake.planning.reach.separation import StaleSpace
from pepper_drake.planning.reach.steadiness import Steadiness
from pepper_drake.short_repr import short_repr

NOWHERE = (np.nan, np.nan, np.nan)
"""Gaze target or base pose that means "none"."""
RESTS = (ReachMode.IDLE, ReachMode.DONE, ReachMode.FAILED)
"""Modes in which the supervisor does nothing."""


class Effect(Enum):
    """Effect of a computation that has finished."""

    BRAKE = "brake"
    """The arm brakes within its acceleration limits and holds still."""
    LOOK = "look"
    """The head looks at a place if the base placement is still being planned."""
    PLACEMENT = "placement"
    """The base drives to the planned base placement, or the reach fails."""
    CHECK = "check"
    """The plan is adopted for the present base pose, or another base placement is planned."""
    START = "start"
    """The arm starts."""
    MOVEMENT = "movement"
    """The arm switches to the plan."""


@dataclass(frozen=True, eq=False)
class Pending:
    """The result of a computation that has not finished in simulated time.

    Attributes:
        due: Time at which it takes effect [s].
        effect: Its effect.
        plan: The resulting plan, if any.
        observation: The observation behind the plan, if it is to be stored or compared.
        suspended_plan: For a retreat or a return, the plan that may be resumed.
        look_at: The place at which to look (3,) in W [m].
    """

    due: float
    effect: Effect
    plan: ReachPlan | None = None
    observation: Observation | None = None
    suspended_plan: ReachPlan | None = None
    look_at: tuple[float, float, float] = NOWHERE


@dataclass(frozen=True, eq=False)
class ReachState:
    """Immutable state of the supervisor.

    It does not depend on the computer's speed: plans take effect `PlanningLatency` after the
    observation that they were made from.

    Attributes:
        mode: Mode of the reach.
        since: When the mode or the present movement began [s].
        goal_seen_since: When the goal was first seen [s]; NaN before.
        base_pose_wanted: Goal of the base, x, y, yaw in W [m, rad]; NaN to stay.
        hip_pitch_wanted: Hip angle to lean to once the base has arrived [rad]; NaN to stay.
        reason: Name of the failure, or of an unconfirmed success; "" for none.
        message: The same as a sentence; while the arm waits, what it could not see, if anything.
        still_since: When the hand arrived at the goal [s]; NaN while it is not there.
        off_since: When the goal was seen to have left a hand that holds [s]; NaN while it has not.
        places: Number of base placements chosen so far.
        placement: The last base placement, with the movement that was found for it. While the
            robot looks for the goal: one whose drive would sweep unseen space.
        plan: The present or next plan; None before there is one.
        travelled: The path (N, 5) on which the arm came to where the present movement began,
            without what it retraced [rad].
        movements: Number of movements begun so far: more than one after replanning.
        braking: Whether the arm, and the base too, brakes or stands until the next plan or depth
            image.
        cloud_time: Capture time of the last cloud against which the movement was checked [s].
        checked: When the reach was last planned from the present base pose, or the last search for
            a detour failed [s].
        planned_with: The observation that the movement was planned with.
        started_with: The observation that the first movement was planned with.
        hanging: (N, 3) points in `started_with` of things that hang in the air near the goal, in
            W [m].
        waits_with: The observation with which the arm retreated or last searched for a detour.
        suspended_plan: The plan to resume after a retreat, or instead of a return; None on a way to
            the goal.
        arrived: When the base last arrived [s].
        started: When the arm first started from the present base pose [s].
        speed: Time scaling of the movement: 1 at full speed.
        performed: Progress of the movement, as time at full speed [s].
        stale: Space ahead that was not seen recently, its time measured like `performed`.
        slowed: Time lost by slowing down, in all movements since `started` [s].
        held: Time since the start that is not counted as time of the reach [s]: at the goal before
            it moved on or something came, and on a return that was not completed.
        waited: Time spent waiting for obstacles to leave since `started` [s].
        blind: Time spent waiting for depth images at this base pose and on the drive to it [s].
        blind_fault: Why the last image that was not used meanwhile was not.
        may_drive: Whether the base may be sent to another base placement.
        given_up: Reason and sentence of why the goal is not reached from the present base pose: the
            arm returns to its first posture, and the robot drives elsewhere. None if it does not.
        given_up_at: When that was decided [s].
        look_at: Gaze target in W [m]: space to be swept that was not seen, or not recently, or the
            obstacle that blocks the path; NaN for none.
        steadiness: Steadiness of the measurements since the arm started; before, since the robot
            began to look.
        pending: Results that have not taken effect.
    """

    __repr__ = short_repr

    mode: ReachMode = ReachMode.LOOKING
    since: float = 0.0
    goal_seen_since: float = np.nan
    base_pose_wanted: tuple[float, float, float] = NOWHERE
    hip_pitch_wanted: float = np.nan
    reason: str = ""
    message: str = ""
    still_since: float = np.nan
    off_since: float = np.nan
    places: int = 0
    placement: ReachPlan | None = None
    plan: ReachPlan | None = None
    travelled: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 5)))
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
    held: float = 0.0
    waited: float = 0.0
    blind: float = 0.0
    blind_fault: DepthFault = DepthFault.NONE
    may_drive: bool = True
    given_up: tuple[str, str] | None = None
    given_up_at: float = np.nan
    look_at: tuple[float, float, float] = NOWHERE
    steadiness: Steadiness = field(default_factory=Steadiness)
    pending: tuple[Pending, ...] = ()

    @property
    def movement(self) -> Movement | None:
        """The plan's movement, whether it has started or not."""
        return None if self.plan is None else self.plan.movement

    @property
    def active_movement(self) -> int:
        """The number of the running movement; 0 for none."""
        return self.movements if self.has_started and not self.braking else 0

    @property
    def performed_origin(self) -> Origin:
        """Origin of the running movement."""
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
        return NOWHERE if self._base_stays else self.base_pose_wanted

    @property
    def hip_pitch_goal(self) -> float:
        """Goal of the hip [rad]; NaN for "brake and stay"."""
        return np.nan if self._base_stays else self.hip_pitch_wanted

    @property
    def _base_stays(self) -> bool:
        return self.mode == ReachMode.FAILED or (self.braking and self.mode == ReachMode.DRIVING)

    @property
    def is_planning(self) -> bool:
        """True while a plan is being computed."""
        return any(one.effect not in (Effect.BRAKE, Effect.LOOK) for one in self.pending)

    @property
    def is_placing(self) -> bool:
        """True while a base placement, or a check of it, is being computed."""
        return any(one.effect == Effect.PLACEMENT for one in self.pending)

    @property
    def will_brake(self) -> bool:
        """True if the arm brakes, or is about to."""
        return self.braking or any(one.effect == Effect.BRAKE for one in self.pending)

    def __deepcopy__(self, memo: dict) -> "ReachState":
        """Returns itself: Drake copies the state at each event, and it is immutable."""
        return self

    def after(self, duration: float) -> "ReachState":
        """Returns the state with a running movement advanced by a duration [s]."""
        if not self.active_movement:
            return self
        moved = self.speed * duration
        return replace(
            self, performed=self.performed + moved, slowed=self.slowed + duration - moved
        )

    def to(self, mode: ReachMode, time: float) -> "ReachState":
        """Returns the state in another mode from now on."""
        return replace(self, mode=mode, since=time, still_since=np.nan, off_since=np.nan)

    def later(self, pending: Pending) -> "ReachState":
        """Returns the state with one more pending result."""
        return replace(self, pending=(*self.pending, pending))

    def with_plan(
        self, plan: ReachPlan, time: float, suspended_plan: ReachPlan | None = None
    ) -> "ReachState":
        """Returns the state of an arm that switches to another plan."""
        retreats_on = None not in (suspended_plan, self.suspended_plan)
        came = self.travelled
        if plan.joint_path is not None:
            came = self.travelled_to(plan.joint_path[0])
        return replace(
            self,
            plan=plan,
            travelled=came,
            movements=self.movements + 1,
            since=time,
            message="",
            still_since=np.nan,
            speed=1.0,
            performed=0.0,
            stale=self.stale if retreats_on else StaleSpace(),
            braking=False,
            suspended_plan=suspended_plan,
            pending=(),
        )

    def travelled_to(self, position: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Returns the path (N, 5) on which the arm came to a position (5,) [rad].

        A retreat retraces it: an arm that retreats once more goes on, and does not turn back.
        """
        path = None if self.plan is None else self.plan.joint_path
        if path is None:
            return position[None]
        retreats = self.movement is not None and self.movement.origin == Origin.RETREAT
        if retreats and len(self.travelled):
            return self.travelled[: nearest_index(self.travelled, position) + 1]
        return np.concatenate((self.travelled, path[: nearest_index(path, position) + 1]))

    def without_images(self, duration: float, fault: DepthFault) -> "ReachState":
        """Returns the state of a robot that waits for depth images for a further duration [s].

        Args:
            duration: [s].
            fault: Why the last image was not used.
        """
        blind_fault = self.blind_fault if fault == DepthFault.NONE else fault
        return replace(self, braking=True, blind=self.blind + duration, blind_fault=blind_fault)

    def anew(self, time: float) -> "ReachState":
        """Returns the state of a robot that looks for goal and base placement from now on."""
        return ReachState(
            since=time,
            base_pose_wanted=self.base_pose_wanted,
            hip_pitch_wanted=self.hip_pitch_wanted,
            places=self.places,
            movements=self.movements,
            given_up=self.given_up,
        )

    def fail(self, time: float, reason: str, message: str) -> "ReachState":
        """Returns the final state of a failure with its name and sentence; the base stays."""
        return replace(
            self.to(ReachMode.FAILED, time),
            reason=reason,
            message=message,
            base_pose_wanted=NOWHERE,
            look_at=NOWHERE,
            pending=(),
        )


def apply_command(state: ReachState, command: ReachCommand, time: float) -> ReachState:
    """Returns the state after a command; a repeated command has no effect.

    Args:
        state: State before.
        command: The command.
        time: Present time [s].
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
