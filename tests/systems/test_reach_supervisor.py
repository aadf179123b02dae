import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import BODY_JOINTS, arm_joints, body_indices
from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.safety.command_check import StopReason
from pepper_drake.systems.reach_supervisor import ReachSupervisor
from tests.planning.reach.scripted_planner import (
    ADAPTED,
    CLOUD,
    DEMONSTRATED,
    P_TG,
    STAND,
    TIMING,
    X_WO,
    ScriptedPlanner,
    path_plan,
)

STEP = TIMING.time_step


class Rig:
    """A supervisor whose ports are set by hand; all is well until something is changed.

    A depth image comes with each step while `images` is set.
    """

    def __init__(self, planner=None):
        self.planner = planner or ScriptedPlanner()
        self.supervisor = ReachSupervisor(self.planner, TIMING, arm="right")
        self.simulator = Simulator(self.supervisor)
        self.context = self.simulator.get_mutable_context()
        self.images = True
        self.set(
            object_pose=X_WO,
            cloud=cloud_at(CLOUD),
            hand_pose=RigidTransform(),
            goal_valid=[1.0],
            goal_age=[0.1],
            goal_position=P_TG,
            cloud_time=[0.0],
            joint_position=np.arange(len(BODY_JOINTS)) / 100,
            base_pose=[0.1, 0.2, 0.3],
            arrived=[1.0],
            tau=[1.0],
            stop_reason=[float(StopReason.NONE)],
        )

    def set(self, **inputs):
        for name, value in inputs.items():
            self.supervisor.GetInputPort(name).FixValue(self.context, value)

    def value(self, name):
        return self.supervisor.GetOutputPort(name).Eval(self.context)

    @property
    def state(self):
        return self.supervisor.progress(self.context)

    def advance(self, duration):
        for _ in range(round(duration / STEP)):
            if self.images:
                self.set(cloud_time=[self.context.get_time()])
            self.simulator.AdvanceTo(self.context.get_time() + STEP)
        return self

    def until(self, mode, limit=10.0):
        while self.state.mode != mode and self.context.get_time() < limit:
            self.advance(STEP)
        assert self.state.mode == mode, self.state.reason
        return self


def cloud_at(points):
    points = np.reshape(points, (-1, 3))
    cloud = PointCloud(len(points))
    cloud.mutable_xyzs()[:] = points.T
    return cloud


def test_a_reach_through_the_ports():
    rig = Rig()
    np.testing.assert_array_equal(rig.value("base_goal"), np.full(3, np.nan))
    rig.until(ReachMode.DRIVING)
    np.testing.assert_array_equal(rig.value("base_goal"), STAND)
    assert rig.value("mode")[0] == ReachMode.DRIVING
    rig.until(ReachMode.SETTLING)
    assert rig.value("movement").id == rig.value("started")[0] == 0
    rig.until(ReachMode.REACHING)
    assert rig.value("movement").id == rig.value("started")[0] == 1
    rig.set(hand_pose=RigidTransform(P_TG))
    rig.until(ReachMode.DONE)
    assert rig.value("movement").id == 1
    assert rig.value("progress") is rig.state


def test_an_arm_that_brakes_is_not_active_but_has_started():
    rig = Rig(ScriptedPlanner(reach=path_plan())).until(ReachMode.REACHING)
    rig.images = False
    rig.advance(TIMING.cloud_timeout + 2 * STEP)
    assert rig.value("mode")[0] == ReachMode.REACHING
    assert rig.value("movement").id == 0
    assert rig.value("started")[0] == 1.0


def test_an_observation_is_what_is_at_the_ports():
    rig = Rig().advance(0.1)
    rig.set(
        desired_position=[1.0, 2.0, 3.0],
        hand_pose=RigidTransform([0.1, 0.2, 0.3]),
        predicted_cloud=cloud_at([X_WO.translation(), X_WO.translation() + [0.5, 0.5, 0.0]]),
        stop_reason=[float(StopReason.REQUESTED)],
        cloud_time=[0.07],
        cloud_fault=[float(DepthFault.FROZEN)],
        goal_valid=[0.0],
        arrived=[0.0],
        goal_age=[0.4],
        tau=[2.5],
    )
    seen = rig.supervisor.observe(rig.context)
    right = body_indices(arm_joints("right"))
    assert seen.time == pytest.approx(0.1)
    np.testing.assert_array_equal(seen.base_pose, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(seen.joint_position, np.arange(15) / 100)
    # Without commands the arm starts at rest, where it is measured.
    np.testing.assert_array_equal(seen.arm.position, np.arange(15)[right] / 100)
    np.testing.assert_array_equal(seen.arm.velocity, np.zeros(5))
    np.testing.assert_array_equal(seen.joint_error, np.zeros(5))
    assert seen.X_WO.IsExactlyEqualTo(X_WO)
    np.testing.assert_allclose(seen.cloud, CLOUD, atol=1e-6)
    # The other one is too far away to matter.
    np.testing.assert_allclose(seen.predicted_cloud, [X_WO.translation()], atol=1e-6)
    np.testing.assert_array_equal(seen.desired_position, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(seen.hand_position, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(seen.goal_position, P_TG)
    assert (seen.cloud_time, seen.goal_age, seen.tau) == (0.07, 0.4, 2.5)
    assert (seen.goal_valid, seen.base_arrived) == (False, False)
    assert seen.stop_reason == StopReason.REQUESTED
    assert seen.cloud_fault == DepthFault.FROZEN

    rig.set(arm_position_command=0.1 * np.ones(5), arm_velocity_command=0.2 * np.ones(5))
    seen = rig.supervisor.observe(rig.context)
    np.testing.assert_array_equal(seen.arm.position, 0.1 * np.ones(5))
    np.testing.assert_array_equal(seen.arm.velocity, 0.2 * np.ones(5))
    np.testing.assert_allclose(seen.joint_error, np.arange(15)[right] / 100 - 0.1)


def test_an_observation_stays_what_it_was_when_the_ports_change():
    rig = Rig()
    seen = rig.supervisor.observe(rig.context)
    rig.set(
        object_pose=RigidTransform(),
        base_pose=np.zeros(3),
        joint_position=np.zeros(15),
        cloud=cloud_at([0.0, 0.0, 0.0]),
    )
    rig.supervisor.observe(rig.context)
    assert seen.X_WO.IsExactlyEqualTo(X_WO)
    np.testing.assert_array_equal(seen.base_pose, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(seen.joint_position, np.arange(15) / 100)
    np.testing.assert_allclose(seen.cloud, CLOUD, atol=1e-6)


def test_a_stop_is_named_by_its_reason():
    rig = Rig().until(ReachMode.REACHING)
    rig.set(stop_reason=[float(StopReason.LINK_TOO_CLOSE)])
    rig.until(ReachMode.FAILED)
    assert rig.state.reason == "link_too_close"
    assert rig.value("movement").id == 0


def test_two_contexts_do_not_share_their_state():
    rig = Rig().until(ReachMode.SETTLING)
    clone = rig.context.Clone()
    before = rig.supervisor.progress(clone)
    rig.until(ReachMode.REACHING)
    assert rig.supervisor.progress(clone) is before
    assert rig.supervisor.progress(rig.supervisor.CreateDefaultContext()).mode == ReachMode.LOOKING


def test_only_the_primitive_is_fed_through_and_only_to_the_movement():
    supervisor = Rig().supervisor
    fed = {
        (supervisor.get_input_port(i).get_name(), supervisor.get_output_port(o).get_name())
        for i in range(supervisor.num_input_ports())
        for o in range(supervisor.num_output_ports())
        if supervisor.HasDirectFeedthrough(i, o)
    }
    assert fed == {("primitive", "movement")}


def test_the_planned_movement_is_known_a_tick_before_it_begins():
    rig = Rig()
    before = None
    while rig.state.mode != ReachMode.REACHING:
        before = rig.value("movement")
        rig.advance(STEP)
    assert before.id == 0
    assert before.primitive is ADAPTED.primitive
    assert before.coupling is None
    np.testing.assert_array_equal(before.X_OG.translation(), [0, 0, 0.1])
    assert rig.value("movement").id == 1


def test_before_the_plan_it_is_the_demonstrated_movement():
    movement = Rig().value("movement")
    assert movement.primitive is DEMONSTRATED.primitive
    assert movement.coupling is DEMONSTRATED.coupling
