"""A supervisor of reaches to try things on, with planners that say what they are told to."""

from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.learning.dmp.coupling import BarrierCoupling
from pepper_drake.models.control_model import BODY_JOINTS
from pepper_drake.planning.ik.command_check import StopReason
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_planner import PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_state import ReachTiming
from pepper_drake.systems.reach_supervisor import ReachSupervisor

STAND = np.array([0.55, -0.05, 0.1])
X_WO = RigidTransform([0.98, -0.11, 0.74])
P_TG = np.array([0.26, -0.2, 0.05])
CLOUD = np.array([[0.9, 0.0, 0.7], [1.0, 0.1, 0.7]])

TIMING = ReachTiming(
    looking=0.5,
    goal_timeout=1.0,
    driving_timeout=2.0,
    settling=0.4,
    goal_lost=3.0,
    holding=0.5,
    reaching_timeout=2.0,
)


SHOWN = Movement(make_primitive(None, "right"), BarrierCoupling(), RigidTransform())
ADAPTED = Movement(make_primitive(None, "left"), None, RigidTransform([0, 0, 0.1]))


def plan(status=PlanStatus.CLEAR, message=""):
    return ReachPlan(status, message, STAND, movement=ADAPTED)


@dataclass
class FakePlanner:
    """Says what it is told to, and keeps what it was asked."""

    stand: ReachPlan = field(default_factory=plan)
    reach: ReachPlan = field(default_factory=plan)
    asked: list = field(default_factory=list)
    demonstrated: Movement = SHOWN

    def plan_base_placement(self, **arguments):
        self.asked.append(("plan_base_placement", arguments))
        return self.stand

    def check_reach(self, **arguments):
        self.asked.append(("check_reach", arguments))
        return self.reach


class Rig:
    """A supervisor whose inputs are set by hand; all is well until something is changed."""

    def __init__(self, planner=None):
        self.planner = planner or FakePlanner()
        self.supervisor = ReachSupervisor(self.planner, TIMING)
        self.simulator = Simulator(self.supervisor)
        self.context = self.simulator.get_mutable_context()
        cloud = PointCloud(len(CLOUD))
        cloud.mutable_xyzs()[:] = CLOUD.T
        self.set(
            object_pose=X_WO,
            cloud=cloud,
            hand_pose=RigidTransform(),
            goal_valid=[1.0],
            goal_age=[0.1],
            goal_position=P_TG,
            cloud_time=[0.1],
            joint_position=np.arange(len(BODY_JOINTS)) / 100,
            base_pose=[0.1, 0.2, 0.3],
            arrived=[1.0],
            tau=[1.0],
            stop_reason=[float(StopReason.NONE)],
        )
        self.was_active = False
        self.modes = [ReachMode.LOOKING]
        self.simulator.set_monitor(self._watch)

    def _watch(self, root):
        self.was_active |= self.value("movement").runs
        mode = ReachMode(int(self.value("mode")[0]))
        if mode != self.modes[-1]:
            self.modes.append(mode)

    def set(self, **inputs):
        for name, value in inputs.items():
            self.supervisor.GetInputPort(name).FixValue(self.context, value)

    def value(self, name):
        return self.supervisor.GetOutputPort(name).Eval(self.context)

    @property
    def progress(self):
        return self.supervisor.progress(self.context)

    def advance(self, duration):
        self.simulator.AdvanceTo(self.context.get_time() + duration)
        return self

    def until(self, mode, limit=10.0):
        while self.progress.mode != mode and self.context.get_time() < limit:
            self.advance(0.05)
        assert self.progress.mode == mode, self.progress
        return self

    def failed(self, reason):
        self.until(ReachMode.FAILED)
        assert self.progress.reason == reason
        assert self.progress.message
        assert self.value("movement").id == 0
        return self


class Blocked(FakePlanner):
    """A planner to whom the way ahead is blocked once the arm is on its way."""

    arm_in_body = np.arange(5)
    ahead = 0.02
    detour = ReachPlan(
        PlanStatus.CLEAR, "", STAND, clearance=0.02, joint_path=np.zeros((9, 5)), movement=SHOWN
    )

    back = ReachPlan(
        PlanStatus.OUT_OF_REACH,
        "",
        STAND,
        clearance=0.05,
        joint_path=np.ones((9, 5)),
        movement=SHOWN,
    )

    def plan_retreat(self, plan, **seen):
        self.asked.append(("plan_retreat", seen))
        return self.back

    def remaining_clearance(self, plan, **seen):
        self.asked.append(("remaining_clearance", seen))
        return self.ahead

    def replan(self, plan, **seen):
        self.asked.append(("replan", seen))
        return self.detour


def way():
    return ReachPlan(
        PlanStatus.CLEAR, "", STAND, clearance=0.02, joint_path=np.ones((9, 5)), movement=SHOWN
    )


def blocked():
    rig = Rig(Blocked(reach=way()))
    rig.set(arm_position_command=0.1 * np.ones(5), arm_velocity_command=0.2 * np.ones(5))
    return rig.until(ReachMode.REACHING).advance(0.1)


def settled(planner, **changes):
    """A rig on its way through SETTLING, changed after the first plan was made."""
    rig = Rig(planner).until(ReachMode.SETTLING)
    rig.advance(0.3)
    assert [name for name, _ in planner.asked][-1] == "check_reach"
    rig.set(**changes)
    planner.asked.clear()
    return rig.until(ReachMode.REACHING)
