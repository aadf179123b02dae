"""Parameters of planning and supervising a reach: tolerances, durations, latencies."""

from dataclasses import dataclass, field

from pepper_drake.errors import InputError
from pepper_drake.planning.collision.clearance_table import ClearanceTable
from pepper_drake.planning.reach.lean_params import LeanParams
from pepper_drake.planning.reach.separation import SeparationParams
from pepper_drake.planning.reach.steadiness import SteadinessParams
from pepper_drake.planning.reach.support_surface import SupportSurfaceParams
from pepper_drake.planning.reach.swept_space import UnseenSpaceParams
from pepper_drake.planning.trajectories.adaptation_params import AdaptationParams
from pepper_drake.planning.trajectories.retreat import NewObstacleParams, RetreatParams
from pepper_drake.short_repr import short_repr, short_signature


@dataclass
class GoalTolerances:
    """Tolerances of the hand's position at its goal, and of the goal's displacement.

    Raises:
        InputError: `arrive` is greater than `accept`, or one is not positive.
    """

    arrive: float = 0.006
    """Distance to the goal at which the hand has arrived, in planning and on the robot [m]."""
    accept: float = 0.010
    """The same at the timeout of a movement, and for the true goal in reports [m]."""
    force: float = 10.0
    """Largest force on the goal object [N]."""
    moved: float = 0.005
    """Displacement of the goal before the arm starts beyond which a plan is made anew [m]."""
    followed: float = 0.015
    """Displacement of the goal up to which a movement follows it as it was planned; beyond, its
    rest is planned anew [m]. A worn robot's estimate moves by a centimetre as the head turns."""
    jumped: float = 0.030
    """Displacement of the goal that is named as the cause of a failure [m]: five times `arrive`."""

    def __post_init__(self) -> None:
        """Checks the order."""
        self.check()

    def check(self) -> None:
        """Raises InputError unless 0 < arrive <= accept; see `ClearanceTable.check`."""
        if not 0.0 < self.arrive <= self.accept:
            raise InputError(
                f"tolerance.accept is {self.accept:g} m; it must be at least "
                f"tolerance.arrive, {self.arrive:g} m, and both positive"
            )


@dataclass
class FollowingErrors:
    """Largest deviations of the arm from its references.

    Raises:
        InputError: Not 0 <= good <= plan < stop.
    """

    good: float = 0.02
    """Largest distance of the hand to the primitive's path in a good plan [m]: where the coupling
    throws it farther off its path, as at the edge of a box, the arm does not follow, and where it
    swings instead depends on details of the cloud."""
    plan: float = 0.12
    """Largest distance of the hand to the primitive's path in an accepted plan [m]."""
    stop: float = 0.20
    """The same on the robot: beyond it the reach fails [m]."""
    contact: float = 0.15
    """Joint error beyond which the arm is held or touches something [rad]: three times the largest
    measured in 15 free reaches, 0.055."""

    def __post_init__(self) -> None:
        """Checks the order."""
        self.check()

    def check(self) -> None:
        """Raises InputError unless 0 <= good <= plan < stop; see `ClearanceTable.check`."""
        if not self.plan < self.stop:
            raise InputError(
                f"following.stop is {self.stop:g} m; it must be greater than "
                f"following.plan, {self.plan:g} m"
            )
        if not 0.0 <= self.good <= self.plan:
            raise InputError(
                f"following.good is {self.good:g} m; it must be between 0 and "
                f"following.plan, {self.plan:g} m"
            )


@dataclass
class CauseParams:
    """Thresholds above which an observation is named as the cause of a failed reach."""

    base_moved: float = 0.03
    """Displacement of the base during a reach [m]."""
    torso_moved: float = 0.05
    """Displacement of hip or knee during a reach [rad]."""
    blind: float = 2.0
    """Time for which the robot waited for depth images [s]."""


@dataclass
class ReachPlannerParams:
    """Criteria of a good reach, and the number of candidates."""

    clearance: ClearanceTable = field(default_factory=ClearanceTable)
    tolerance: GoalTolerances = field(default_factory=GoalTolerances)
    following: FollowingErrors = field(default_factory=FollowingErrors)
    cause: CauseParams = field(default_factory=CauseParams)
    support_surface: SupportSurfaceParams = field(default_factory=SupportSurfaceParams)
    unseen: UnseenSpaceParams = field(default_factory=UnseenSpaceParams)
    hand_x: float = 0.26
    """Preferred distance of the hand's goal ahead of the torso frame [m], if the demonstration's
    end is not within the arm's reach (because it was recorded in another frame)."""
    hand_y: float = 0.20
    """The same to the arm's side [m]."""
    reach: float = 0.39
    """Largest distance of the hand from the shoulder [m]: 0.41 m stretched, less a margin."""
    obstacle_range: float = 1.0
    """Distance from the torso frame beyond which obstacles are out of the arm's reach [m]."""
    reach_margin: float = 0.08
    """Displacement of the goal away from the robot that should stay within reach, if possible
    [m]."""
    body_clearance: float = 0.02
    """Clearance of the whole robot but the reaching arm to the cloud at a base placement [m]."""
    drive_clearance: float = 0.015
    """Clearance of the whole robot to the cloud on the straight drive to a base placement [m]: more
    than the 0.01 m at which it stops during the drive, as its spheres bulge out by as much."""
    placement_clearance_tolerance: float = 0.004
    """Clearance that a base placement may lose to the cloud's noise before the drive begins [m]:
    twice the variation in a still scene."""
    object_clearance: float = 0.002
    """Clearance of an adapted movement to the goal object, whose shape and pose are known [m]."""
    predrive_clearance_tolerance: float = 0.008
    """Clearance by which a plan made from a distance may fall short [m]; it is checked again on
    arrival, where the view of the scene is better."""
    self_clearance: float = -0.012
    """Clearance of the arm's spheres, which are larger than the arm, to the body in the search for
    a path [m]."""
    hanging_clearance: float = 0.0
    """Clearance of the arm to hip and leg [m]: hanging down it is 1 to 5 mm from them."""
    upper_body_clearance: float = 0.004
    """Clearance of the arm to torso, tablet, other arm, and the head at any angle [m]: the tracking
    error at 0.5 m/s."""
    body_clearance_allowance: float = 0.004
    """Clearance to the own body that an arm on its way may lack as a detour, a retreat or a return
    begins [m]: the tracking error at 0.5 m/s. It comes no nearer, and ends clear."""
    solid_depth: float = 0.03
    """Thickness that is assumed below each point of the cloud [m]: that of a table top."""
    settle: float = 0.4
    """Settling time of the simulated movement after its end, in units of tau."""
    still_speed: float = 0.02
    """Joint speed below which the simulated arm counts as at rest at its goal [rad/s]."""
    turn_error: float = 0.01
    """Margin that an adapted movement keeps to the scene's tolerance of the hand's axis [rad]: what
    estimating the goal and following the movement cost."""
    rest_fraction: float = 0.06
    """Fraction of an adapted movement for which it rests at its end: there the forcing term learns
    to be zero; otherwise its remainder would move the hand about at the goal."""
    max_placements_with_margin: int = 3
    """Largest number of simulated base placements with `reach_margin`."""
    max_simulated_placements: int = 8
    """Largest number of other simulated base placements."""
    adapt: bool = True
    """True to adapt a movement that is not clear, for the whole arm; needs a
    `BarrierCoupling`."""
    collision_checked: bool = True
    """True to check the movement with its coupling for collisions before the arm starts and while
    it moves. If False, reach and base placement are evaluated without coupling, and links too close
    to an obstacle do not stop the arm: the setting in which some couplings were published."""
    adaptation: AdaptationParams = field(default_factory=AdaptationParams)
    """Parameters of that adaptation."""
    barrier_margin: float = 0.003
    """Margin of the barrier fitted to a planned path [m]: the hand does not follow it exactly."""
    retreat: RetreatParams = field(default_factory=RetreatParams)
    """Retreat from an obstacle."""
    new_obstacle: NewObstacleParams = field(default_factory=NewObstacleParams)
    """Criteria of new points, and the extent of their unseen sides."""
    min_detour_duration: float = 0.8
    """Least duration of a movement that is adapted while the arm moves [s]."""
    acceptable_duration_ratio: float = 1.6
    """Duration relative to the demonstration's up to which a plan is taken without comparison."""
    max_adapted_placements: int = 4
    """Base placements for which the movement is adapted at most."""
    max_path_planner_placements: int = 20
    """Base placements for which the path planner is asked at most, if no movement can be adapted:
    each costs 0.1 s of a processor."""
    lean: LeanParams = field(default_factory=LeanParams)
    """Leaning forward to low goals."""
    wide_search_placements: int = 40
    """Number of base placements that are ranked if none of the usual ones is good enough."""

    __repr__ = short_repr
    __signature__ = short_signature


@dataclass
class PlanningLatency:
    """Simulated time from an observation to the effect of the computation made from it.

    Each is more than the 90th percentile of the processor time on one core of a quiet machine, in
    eight moving scenes (seeds 2000 to 2007; `benchmarks/loop_speed.py planner --scenes 8`).
    """

    base_placement: float = 1.6
    """Latency of base placement [s]; the robot waits. Measured with the looks along the drive
    meanwhile: 0.27 and 8 times 0.06; where only the path planner finds a path, from the last of
    many base placements, 0.6 to 1.9 without them."""
    plan: float = 0.05
    """Latency of checks, replans and retreats [s]; the arm goes on or brakes meanwhile. Measured:
    0.033, for all that the planner is asked in one step of supervision."""
    drive: float = 0.1
    """Latency of a check of the drive, and of a look along it, which is computed before the base
    placement [s]; the robot waits. Measured: 0.064."""
    check: float = 0.05
    """Latency of the remaining clearance [s], and thus of a brake or start that follows from it.
    Measured: 0.006; the supervisor cannot act faster than its period."""


@dataclass
class ReachTiming:
    """Durations and timeouts of the reach."""

    time_step: float = 0.05
    """Period of supervision [s]."""
    latency: PlanningLatency = field(default_factory=PlanningLatency)
    steadiness: SteadinessParams = field(default_factory=SteadinessParams)
    separation: SeparationParams = field(default_factory=SeparationParams)
    looking: float = 1.2
    """Time for which the robot looks at the scene once the goal is seen [s]: six depth images."""
    drives: bool = True
    """True if the base may drive; otherwise it stays in place."""
    goal_timeout: float = 14.0
    """Longest search for the goal [s]: the head's first look, 1.5 s, and eight views in 11.2 s."""
    unseen_timeout: float = 5.0
    """Longest look at unseen space that arm or drive would sweep [s]."""
    driving_timeout: float = 20.0
    """Longest drive to one base placement [s]."""
    base_near: float = 0.05
    """Distance to its place within which a base that did not arrive in time, and still moves, is
    unsteady [m]."""
    settling: float = 0.6
    """Time for which the robot stands and looks again before it reaches [s]."""
    settling_timeout: float = 10.0
    """Longest time to find and confirm a plan after a drive [s]."""
    goal_lost: float = 12.0
    """Age of the last sighting of the goal at which it counts as lost [s]."""
    goal_confirmed: float = 2.0
    """Largest age of the last sighting of the goal that confirms a reach [s]: the head looks
    elsewhere for up to 1.4 s."""
    confirmation_timeout: float = 8.0
    """Longest wait at the goal for such a sighting, after `holding` [s], or until `goal_lost`: the
    head searches the table for a goal that was taken elsewhere."""
    max_base_placements: int = 3
    """Largest number of base placements that are driven to, if the reach is not clear there."""
    longest: float = 120.0
    """Longest time of a reach, or of a task after it, from the beginning to the end [s]: two drives
    elsewhere, each after the longest wait. A run that is not over then is ended."""
    dwell: float = 0.2
    """Time for which the hand must stay within its tolerance to have arrived [s]."""
    holding: float = 1.0
    """Time for which the hand stays at the goal before the reach is done [s]."""
    movement_timeout_ratio: float = 2.5
    """Longest duration of one movement, in units of tau."""
    reach_timeout: float = 35.0
    """Longest time from the arm's start to its arrival, replanning included [s]."""
    max_slowdown_extension: float = 25.0
    """Largest extension of `reach_timeout` for slowing down [s]: time to pass 1 m along a
    stationary obstacle, at 0.04 m/s."""
    blocked_timeout: float = 20.0
    """Longest time for which the arm waits for obstacles to leave, summed over its retreats [s]."""
    return_timeout: float = 20.0
    """Longest time for the arm to find back to its first posture, before the robot drives elsewhere
    [s]: half a metre at the speed of narrow places takes 12."""
    detour_delay: float = 4.0
    """Time for which the arm waits for a new obstacle to leave before a detour is planned [s]."""
    gentle_duration: float = 4.0
    """Duration of a gentle movement relative to the demonstration, whose fastest point would
    otherwise exceed 250 mm/s."""
    gentle_speed: float = 0.15
    """Largest fraction of the joints' rated speed that a gentle arm uses."""
    timing_error: float = 0.2
    """Largest lead or lag of the arm on its path that predictions account for, such as by phase
    stopping [s]."""
    at_rest: float = 0.1
    """Joint speed below which an entirely new plan may be made for a waiting arm [rad/s]."""
    replan_clearance_loss: float = 0.003
    """Loss of clearance that triggers a replan of a plan with less than the clearance `replan`
    [m]."""
    images_lost: float = 2.0
    """Age of a colour camera's newest image above which it is the reason for an unseen goal [s]."""
    cloud_timeout: float = 0.5
    """Age of the last depth image at which arm and base stop [s]; images arrive every 0.2 s."""
    cloud_lost: float = 2.0
    """Age of the last depth image at which the reach ends [s]."""
