"""What the reach supervisor remembers, and how long it waits for what."""

from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.math import RigidTransform
from scipy.spatial import cKDTree

from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_plan import ReachPlan


@dataclass
class ReachTiming:
    """Durations and tolerances of the reach, s, m [m/s]."""

    looking: float = 1.2
    """How long the scene is looked at, once the goal is seen."""
    goal_timeout: float = 14.0
    """How long the goal is searched for."""
    driving_timeout: float = 20.0
    settling: float = 0.6
    """How long the robot stands and looks again before it reaches."""
    goal_lost: float = 12.0
    """Age of the last sight of the goal at which it counts as lost."""
    cloud_lost: float = 0.5
    """Age of the last depth image from which on the robot does not begin to move, nor goes on."""
    places: int = 3
    """How many places to stand are driven to at most, when from near the reach looks different."""
    holding: float = 1.0
    """How long the hand stays at the goal before the job is done."""
    reaching_timeout: float = 2.5
    """In units of tau."""
    following_error: float = 0.2
    """Distance of the hand to where the primitive wants it at which it counts as unable to follow:
    the inverse kinematics found no way, or something holds the arm."""
    position_tolerance: float = 0.006
    """Distance of the hand to the goal at which it has arrived."""
    accepted_position: float = 0.010
    """The same, when the time is over."""
    goal_moved: float = 0.005
    """A plan whose goal moved farther than this before the arm starts is made anew."""
    blocked_timeout: float = 20.0
    """How long after its start the arm may still wait for something in its way to go."""
    detour_delay: float = 4.0
    """How long the arm waits for what came in its way before a way around it is looked for."""
    remaining_clearance: float = 0.012
    """With less between the rest of the arm's way and what is seen, it is planned anew."""
    clearance_resumed: float = 0.015
    """An arm that waited goes on with less only if no better way is found from where it is."""
    clearance_lost: float = 0.003
    """A plan with less clearance than that is planned anew when it has lost so much of it."""


@dataclass(frozen=True)
class ReachState:
    """The supervisor's state; each change makes a new one.

    Attributes:
        mode: What the robot is doing.
        since: Time at which it began [s].
        goal_seen_since: Time at which the goal was first seen [s]; NaN before.
        base_goal: Where the base should stand, x, y, yaw in W; NaN means: where it is.
        reason: Name of the outcome: "" while all is well, else what went wrong in one word.
        sentence: The same as a sentence.
        still_since: Since when the hand has been at the goal [s]; NaN when it is not.
        places: How many places to stand were chosen so far.
        planning_seconds: Computing time of the last plan, or of confirming it, when the arm could
            have started [s]: what it waited for. The only value here that no seed decides.
        planned: The movement that was found for the place to stand.
        plan: What is to be performed; None before it is decided.
        movements: How many movements began so far: more than one when something came in the way.
        cloud_time: Of the last cloud in which the way ahead was looked at [s].
        checked: When the reach was last planned from where the robot stands, or a way around
            something in vain [s].
        known: The cloud in W with which the movement was planned [m].
        X_WO: The goal object's pose for which it was planned.
        blocked: While the arm has withdrawn from something in its way: the plan that it goes on
            with when that has gone.
        begun: When the arm first started [s].
    """

    mode: ReachMode = ReachMode.LOOKING
    since: float = 0.0
    goal_seen_since: float = np.nan
    base_goal: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    reason: str = ""
    message: str = ""
    still_since: float = np.nan
    places: int = 0
    planning_seconds: float = np.nan
    planned: Movement | None = None
    plan: ReachPlan | None = None
    movements: int = 0
    cloud_time: float = np.nan
    checked: float = np.nan
    planned_cloud: cKDTree | None = None
    X_WO: RigidTransform = field(default_factory=RigidTransform)
    suspended_plan: ReachPlan | None = None
    begun: float = np.nan

    @property
    def movement(self) -> Movement | None:
        """Of the plan."""
        return None if self.plan is None else self.plan.movement

    def __deepcopy__(self, memo: dict) -> "ReachState":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self

    def to(self, mode: ReachMode, time: float) -> "ReachState":
        """The same robot, doing something else from now on."""
        return replace(self, mode=mode, since=time, still_since=np.nan)

    def with_plan(self, plan: ReachPlan, time: float) -> "ReachState":
        """The same robot, whose arm goes over to another plan."""
        return replace(self, plan=plan, movements=self.movements + 1, since=time)

    def fail(self, time: float, reason: str, message: str) -> "ReachState":
        """The end, with the base where it is: what went wrong, as a word and as a sentence."""
        stay = (np.nan, np.nan, np.nan)
        failed = self.to(ReachMode.FAILED, time)
        return replace(failed, reason=reason, message=message, base_goal=stay)
