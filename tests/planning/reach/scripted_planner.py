"""A planner that gives prepared answers, and a robot on which all is well, without Drake.

Not a robot that moves: each test says what is observed, and when.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling
from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import (
    PlanningLatency,
    ReachPlannerParams,
    ReachTiming,
)
from pepper_drake.planning.reach.reach_plan import (
    Planner,
    PlanStatus,
    ReachPlan,
    RemainingClearance,
)
from pepper_drake.planning.reach.reach_state import ReachState
from pepper_drake.planning.reach.reach_state_machine import step
from pepper_drake.planning.reach.separation import StaleSpace

STAND = np.array([0.55, -0.05, 0.1])
X_WO = RigidTransform([0.98, -0.11, 0.74])
P_TG = np.array([0.26, -0.2, 0.05])
CLOUD = np.array([[0.9, 0.0, 0.7], [1.0, 0.1, 0.7]])
BESIDE = X_WO.translation() + [0.1, 0.2, 0.1]
"""A place near the goal at which nothing was when the reach was planned."""
THING = BESIDE + 0.02 * (np.argwhere(np.ones((3, 2, 2))) - [1.0, 0.5, 0.5])
"""Points of a thing there, as far apart as those of a cloud."""

TIMING = ReachTiming(
    latency=PlanningLatency(base_placement=0.4, plan=0.2, check=0.05),
    looking=0.5,
    goal_timeout=1.0,
    driving_timeout=2.0,
    settling=0.4,
    goal_lost=3.0,
    confirmation_timeout=3.0,
    holding=0.5,
    movement_timeout_ratio=2.0,
)

DEMONSTRATED = Movement(make_primitive(None, "right"), BarrierCoupling(), RigidTransform())
ADAPTED = Movement(make_primitive(None, "left"), None, RigidTransform([0, 0, 0.1]))


def plan(status: PlanStatus = PlanStatus.CLEAR, message: str = "") -> ReachPlan:
    """A plan without a path: nothing is checked against later clouds."""
    return ReachPlan(status, message, STAND, movement=ADAPTED)


def path_plan(clearance: float = 0.02) -> ReachPlan:
    """A clear plan whose first joint moves at 0.5 rad/s for 2 s."""
    joints = np.zeros((101, 5))
    joints[:, 0] = np.linspace(0.0, 1.0, 101)
    return ReachPlan(
        PlanStatus.CLEAR, "", STAND, 0.0, clearance, joints, DEMONSTRATED, time_step=0.02
    )


STALE = StaleSpace((0.9, -0.3, 0.8), 0.5, 0.5)
"""Space on the way that was not seen lately."""

NO_DETOUR = plan(PlanStatus.NO_CLEAR_PATH, "no path")


@dataclass
class ScriptedPlanner:
    """Gives the answers that a test prepared, and keeps the questions.

    Attributes:
        placement: Answer to `plan_base_placement`.
        way: Answer to `look_along_drive`.
        drive: Answer to `check_drive`.
        reach: Answer to `check_reach`.
        detour: Answer to `replan`.
        back: Answer to `plan_retreat`.
        home: Answer to `plan_return`.
        ahead_on_return: Least distance on that path [m].
        ahead: Least distance of the rest of a path, from `ahead_from` on [m].
        ahead_from: Time from now at which the path is as near as that [s].
        distances: Distances by time from now, in place of these two.
        stale: Space on the path that was not seen lately.
        stale_after_a_visit: The same once something came in the way.
        travelled: The path for which a retreat was last asked.
        asked: Name and observation of each question.
    """

    placement: ReachPlan = field(default_factory=plan)
    way: npt.NDArray[np.float64] = field(default_factory=lambda: np.full(3, np.nan))
    drive: ReachPlan = field(default_factory=plan)
    reach: ReachPlan = field(default_factory=plan)
    detour: ReachPlan = field(default_factory=path_plan)
    back: ReachPlan = field(
        default_factory=lambda: replace(
            path_plan(),
            status=PlanStatus.OUT_OF_REACH,
            clearance=0.05,
            movement=replace(DEMONSTRATED, origin=Origin.RETREAT),
        )
    )
    home: ReachPlan = field(default_factory=lambda: NO_DETOUR)
    ahead_on_return: float = 0.1
    ahead: float = 0.02
    ahead_from: float = 1.0
    distances: dict[float, float] = field(default_factory=dict)
    stale: StaleSpace = field(default_factory=StaleSpace)
    stale_after_a_visit: StaleSpace = field(default_factory=StaleSpace)
    travelled: npt.NDArray[np.float64] | None = None
    asked: list[tuple[str, Observation]] = field(default_factory=list)
    demonstrated: Movement = DEMONSTRATED
    params: ReachPlannerParams = field(default_factory=ReachPlannerParams)
    limits: CommandLimits = field(
        default_factory=lambda: CommandLimits(
            np.full(5, -3.0), np.full(5, 3.0), np.full(5, 3.0), np.full(5, 10.0)
        )
    )

    def plan_base_placement(self, observation: Observation) -> ReachPlan:
        self.asked.append(("plan_base_placement", observation))
        return self.placement

    def check_reach(self, observation: Observation, movement: Movement | None = None) -> ReachPlan:
        self.asked.append(("check_reach", observation))
        return self.reach

    def look_along_drive(self, observation: Observation) -> npt.NDArray[np.float64]:
        self.asked.append(("look_along_drive", observation))
        return self.way

    def check_drive(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        self.asked.append(("check_drive", observation))
        return self.drive

    def replan(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        self.asked.append(("replan", observation))
        return self.detour

    def plan_retreat(
        self, travelled: npt.NDArray[np.float64], observation: Observation
    ) -> ReachPlan:
        self.asked.append(("plan_retreat", observation))
        self.travelled = travelled
        return self.back

    def plan_return(
        self,
        travelled: npt.NDArray[np.float64],
        posture: npt.NDArray[np.float64],
        observation: Observation,
    ) -> ReachPlan:
        self.asked.append(("plan_return", observation))
        return self.home

    def remaining_clearance(self, plan: ReachPlan, observation: Observation) -> RemainingClearance:
        self.asked.append(("remaining_clearance", observation))
        if self.distances:
            times = np.array(list(self.distances))
            return RemainingClearance(times, np.array(list(self.distances.values())))
        if plan is self.home:
            return RemainingClearance(np.zeros(1), np.array([self.ahead_on_return]))
        far = max(self.ahead, 0.1)
        return RemainingClearance(
            np.array([0.0, self.ahead_from]),
            np.array([self.ahead if self.ahead_from == 0.0 else far, self.ahead]),
        )

    def stale_space(
        self,
        plan: ReachPlan,
        observation: Observation,
        new_obstacle: npt.NDArray[np.float64],
        movable: npt.NDArray[np.float64],
    ) -> StaleSpace:
        return self.stale_after_a_visit if len(new_obstacle) else self.stale

    def questions(self) -> list[str]:
        """Names of the questions that were asked."""
        return [name for name, _ in self.asked]

    def last(self, name: str) -> Observation:
        """The observation of the last question of a name."""
        return [observation for asked, observation in self.asked if asked == name][-1]


class Supervised:
    """A state that is stepped every 50 ms with an observation that a test may change.

    Depth images come with each step unless `image_time` is set.
    """

    def __init__(self, planner: ScriptedPlanner | None = None, timing: ReachTiming = TIMING):
        self.planner = ScriptedPlanner() if planner is None else planner
        checked: Planner = self.planner  # The type checker holds it against the protocol.
        self._step: Callable[[ReachState, Observation], ReachState] = lambda state, seen: step(
            state, seen, checked, timing
        )
        self.state = ReachState()
        self.ticks = 0
        self.image_time: float | None = None
        self.modes = [ReachMode.LOOKING]
        self.was_active = False
        self.seen = Observation(
            time=0.0,
            base_pose=np.array([0.1, 0.2, 0.3]),
            joint_position=np.arange(15) / 100,
            arm=ArmState(np.zeros(5), np.zeros(5)),
            X_WO=X_WO,
            cloud=CLOUD,
            goal_age=0.1,
            goal_position=P_TG,
            hand_position=np.zeros(3),
            measured_arm=np.zeros(5),
        )

    @property
    def time(self) -> float:
        """Time of the next step [s]."""
        return 0.05 * self.ticks

    def set(self, **changes) -> "Supervised":
        """Changes what is observed from now on."""
        self.seen = replace(self.seen, **changes)
        return self

    def step(self) -> ReachState:
        """One step."""
        image = self.time if self.image_time is None else self.image_time
        self.state = self._step(self.state, replace(self.seen, time=self.time, cloud_time=image))
        self.ticks += 1
        self.was_active |= self.state.active_movement > 0
        if self.state.mode != self.modes[-1]:
            self.modes.append(self.state.mode)
        return self.state

    def look(self) -> "Supervised":
        """One step with a new depth image; later ones have none until the next look."""
        self.image_time = self.time
        self.step()
        return self

    def advance(self, duration: float) -> "Supervised":
        """Steps for some time [s]."""
        for _ in range(round(duration / 0.05)):
            self.step()
        return self

    def until(self, mode: ReachMode, limit: float = 10.0) -> "Supervised":
        """Steps until a mode is there."""
        while self.state.mode != mode and self.time < limit:
            self.step()
        assert self.state.mode == mode, (self.state.mode, self.state.reason)
        return self

    def failed(self, reason: str, limit: float = 10.0) -> "Supervised":
        """Steps until the reach has failed, and says why it should have."""
        self.until(ReachMode.FAILED, limit)
        assert self.state.reason == reason, self.state.message
        assert self.state.message
        assert self.state.active_movement == 0
        return self


def on_its_way(timing: ReachTiming = TIMING, **prepared) -> Supervised:
    """An arm that moves, at 0.3 rad of its path; a depth image comes with the next look."""
    supervised = Supervised(ScriptedPlanner(reach=path_plan()), timing)
    supervised.until(ReachMode.REACHING).advance(0.55)
    for name, answer in prepared.items():
        setattr(supervised.planner, name, answer)
    velocity = np.array([0.5, 0.0, 0.0, 0.0, 0.0])
    supervised.set(arm=ArmState(np.array([0.3, 0, 0, 0, 0]), velocity))
    supervised.set(measured_arm=supervised.seen.arm.position)
    supervised.image_time = supervised.time - 0.05
    supervised.planner.asked.clear()
    return supervised


def unseen_plan():
    region = np.full((20, 3), [1.0, -0.3, 0.8])
    unseen = plan(PlanStatus.NOT_SEEN, "not seen")
    return replace(unseen, unseen=region, look_at=region[0])
