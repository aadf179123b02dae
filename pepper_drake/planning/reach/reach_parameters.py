"""Parameters of planning and supervising a reach: tolerances, durations, latencies."""

from dataclasses import dataclass, field

from pepper_drake.errors import InputError
from pepper_drake.planning.collision.clearance_table import ClearanceTable
from pepper_drake.planning.reach.separation import SeparationParams
from pepper_drake.planning.reach.steadiness import SteadinessParams
from pepper_drake.planning.reach.support_surface import SupportSurfaceParams
from pepper_drake.planning.reach.swept_space import UnseenSpaceParams
from pepper_drake.planning.trajectories.adaptation_params import AdaptationParams
from pepper_drake.planning.trajectories.retreat import NewObstacleParams, RetreatParams
from pepper_drake.short_repr import short_repr, short_signature


@dataclass
class GoalTolerances:
    """Distances of the hand to its goal, and of the goal to where it was.

    Raises:
        InputError: `arrive` is greater than `accept`, or one is not positive.
    """

    arrive: float = 0.006
    """The hand has arrived, in planning as on the robot [m]."""
    accept: float = 0.010
    """The same when the time is over, and for the true goal in reports [m]."""
    force: float = 10.0
    """Largest force with which the goal object may be pushed [N]."""
    moved: float = 0.005
    """A plan whose goal moved farther before the arm starts is made anew [m]."""
    jumped: float = 0.030
    """A goal that moved farther is named as the cause of a failure [m]: five times `arrive`."""

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
        InputError: `plan` is not smaller than `stop`.
    """

    plan: float = 0.12
    """Distance of the hand to the primitive's path in a plan that is accepted [m]."""
    stop: float = 0.20
    """The same on the robot: beyond it the arm cannot follow [m]."""
    contact: float = 0.15
    """A joint this far from its command is held, or touches something [rad]: three times the most
    that was measured in 15 free reaches, 0.055."""

    def __post_init__(self) -> None:
        """Checks the order."""
        self.check()

    def check(self) -> None:
        """Raises InputError unless plan < stop; see `ClearanceTable.check`."""
        if not self.plan < self.stop:
            raise InputError(
                f"following.stop is {self.stop:g} m; it must be greater than "
                f"following.plan, {self.plan:g} m"
            )


@dataclass
class CauseParams:
    """Observations that are named as the cause of a failed reach."""

    base_moved: float = 0.03
    """Displacement of the base during a reach [m]."""
    torso_moved: float = 0.05
    """The same for hip and knee [rad]."""
    blind: float = 2.0
    """Time for which the arm waited for depth images [s]."""


@dataclass
class ReachPlannerParams:
    """Criteria of a good reach, and how many candidates are tried."""

    clearance: ClearanceTable = field(default_factory=ClearanceTable)
    tolerance: GoalTolerances = field(default_factory=GoalTolerances)
    following: FollowingErrors = field(default_factory=FollowingErrors)
    cause: CauseParams = field(default_factory=CauseParams)
    support_surface: SupportSurfaceParams = field(default_factory=SupportSurfaceParams)
    unseen: UnseenSpaceParams = field(default_factory=UnseenSpaceParams)
    hand_x: float = 0.26
    """Preferred goal of the hand ahead of the torso frame [m], if the demonstration's own end is
    not within the arm's reach (because it was recorded in another frame)."""
    hand_y: float = 0.20
    """The same to the arm's side [m]."""
    reach: float = 0.39
    """Farthest distance of the hand from the shoulder [m]: 0.41 m stretched, less a margin."""
    obstacle_range: float = 1.0
    """Distance of obstacles from the torso's frame beyond which they are out of the arm's reach
    [m]."""
    slack: float = 0.08
    """Displacement of the goal that should still be within reach, if possible [m]."""
    body_clearance: float = 0.02
    """Between the cloud and all of the robot but the reaching arm, where the base is placed [m]."""
    drive_clearance: float = 0.015
    """Between the cloud and all of the robot on the straight way to where the base is placed [m]:
    more than the 0.01 m at which it stops on the way, as its spheres bulge out by as much."""
    room_lost: float = 0.004
    """Room that a base placement may lose, by the cloud's noise, until the base drives there [m]:
    twice what the cloud of a still scene changes by."""
    object_clearance: float = 0.001
    """Between an adapted movement and the goal object, whose shape and pose are known [m]."""
    far_allowance: float = 0.008
    """Clearance by which a plan made from a distance may fall short [m]; it is checked again on
    arrival, from where the scene is seen better."""
    self_clearance: float = -0.012
    """Between the arm's spheres, which are larger than the arm, and the body [m]."""
    solid_depth: float = 0.03
    """Thickness that is assumed below each point of the cloud [m]: that of a table top."""
    settle: float = 0.4
    """Time that the simulated movement goes on after its end, in units of tau."""
    still_speed: float = 0.02
    """Joint speed below which the arm stands, at its goal in the simulated movement [rad/s]."""
    rest_share: float = 0.06
    """Share of an adapted movement during which it rests at its end: there the forcing term learns
    to be zero, or else what is left of it would push the hand about at its goal."""
    places_with_slack: int = 3
    """Base placements with `slack` that are simulated at most."""
    places_tried: int = 8
    """Other base placements that are simulated at most."""
    adapt: bool = True
    """True to adapt a movement that is not clear, for the whole arm; needs a
    `BarrierCoupling`."""
    collision_checked: bool = True
    """True to check the movement with its coupling for collisions before the arm starts and on its
    way. If not, reach and base placement are judged without coupling, and no link that comes too
    close stops the arm: the setting in which some couplings were published."""
    adaptation: AdaptationParams = field(default_factory=AdaptationParams)
    """Parameters of that adaptation."""
    barrier_margin: float = 0.003
    """Margin to the barrier's radius that a planned path allows [m]: the hand does not follow it
    exactly."""
    retreat: RetreatParams = field(default_factory=RetreatParams)
    """Way back from an obstacle."""
    new_obstacle: NewObstacleParams = field(default_factory=NewObstacleParams)
    """Points that count as new, and their unseen sides."""
    shortest_detour: float = 0.8
    """Least duration of a movement that is adapted on its way [s]."""
    slowest: float = 1.6
    """Duration, in those of the demonstration, up to which a plan is taken at once."""
    places_adapted: int = 4
    """Base placements for which the movement is adapted at most."""
    places_planned: int = 20
    """Base placements for which the path planner is asked at most, if no movement can be adapted:
    each costs 0.1 s of a processor."""
    places_searched: int = 40
    """Base placements that are ranked, where none of the usual ones will do."""

    __repr__ = short_repr
    __signature__ = short_signature


@dataclass
class PlanningLatency:
    """Simulated time from an observation to the effect of what was computed from it.

    Each is more than the 90th percentile of the processor time on one core of a quiet machine, in
    eight moving scenes (seeds 2000 to 2007; `benchmarks/loop_speed.py planner --scenes 8`).
    """

    base_placement: float = 1.6
    """Latency of base placement [s]; the robot waits. Measured: median 0.31; the two refusals,
    which try most and after which nothing moves, 2.5."""
    plan: float = 0.1
    """Latency of checks, replans and retreats [s]; the arm goes on or brakes meanwhile. Measured:
    90th percentiles 0.030, 0.054 and 0.025; answers take effect at the supervisor's period."""
    check: float = 0.05
    """Latency of the remaining clearance [s]: a brake or a start follows it by this.
    Measured: 0.006; the supervisor's period is the shortest time in which it can act."""


@dataclass
class ReachTiming:
    """Durations of the reach and its timeouts."""

    time_step: float = 0.05
    """Period of supervision [s]."""
    latency: PlanningLatency = field(default_factory=PlanningLatency)
    steadiness: SteadinessParams = field(default_factory=SteadinessParams)
    separation: SeparationParams = field(default_factory=SeparationParams)
    looking: float = 1.2
    """Time for which the scene is looked at, once the goal is seen [s]: six depth images."""
    drives: bool = True
    """True if the base may drive; otherwise it stays where it is."""
    goal_timeout: float = 14.0
    """Longest search for the goal [s]: two sweeps of the head, and two to come."""
    unseen_timeout: float = 5.0
    """Longest look at what the arm is going to sweep and was not seen, after a drive [s]."""
    driving_timeout: float = 20.0
    """Longest drive to one base placement [s]."""
    settling: float = 0.6
    """Time for which the robot stands and looks again before it reaches [s]."""
    settling_timeout: float = 10.0
    """Longest time to find and confirm a plan after a drive [s]."""
    goal_lost: float = 12.0
    """Age of the last sighting of the goal at which it counts as lost [s]."""
    goal_confirmed: float = 2.0
    """Greatest age of the last sighting of the goal with which a reach is confirmed [s]: the head
    looks elsewhere for up to 1.4 s."""
    confirmation_timeout: float = 3.0
    """Longest wait at the goal for such a sighting, after `holding` [s]."""
    places: int = 3
    """Base placements that are driven to at most, when from near the reach is not clear."""
    dwell: float = 0.2
    """Time for which the hand must stay within its tolerance to have arrived [s]."""
    holding: float = 1.0
    """Time for which the hand stays at the goal before the job is done [s]."""
    reaching_timeout: float = 2.5
    """Longest duration of one movement, in units of tau."""
    reach_timeout: float = 35.0
    """Longest time from the arm's first start to its arrival, whatever was replanned [s]."""
    slow_reach: float = 25.0
    """By how much longer it may take where the arm slows down [s]: past an obstacle that stays, at
    0.04 m/s, it gets a metre."""
    blocked_timeout: float = 20.0
    """Time for which the arm waits for obstacles to leave, in all its retreats [s]."""
    detour_delay: float = 4.0
    """Time for which the arm waits for a new obstacle to leave before a detour is planned [s]."""
    gentle_duration: float = 4.0
    """Duration of a gentle movement, in those of the demonstration, whose fastest point would else
    exceed 250 mm/s."""
    gentle_speed: float = 0.15
    """Share of the joints' rated speed that a gentle arm uses at most."""
    timing_error: float = 0.2
    """Greatest lead or lag of the arm on its path, such as by phase stopping, that is noticed
    [s]."""
    at_rest: float = 0.1
    """Joint speed below which a whole new plan may be made for an arm that waits [rad/s]."""
    clearance_lost: float = 0.003
    """A plan with less than the clearance `replan` is made anew when it has lost this much [m]."""
    images_lost: float = 2.0
    """Age of a colour camera's newest image from which on a goal is unseen for want of it [s]."""
    cloud_timeout: float = 0.5
    """Age of the last depth image at which arm and base stop [s]; images come every 0.2 s."""
    cloud_lost: float = 2.0
    """The same at which the reach ends [s]."""
