from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import BusValue, PortDataType

from pepper_drake.benchmarking.case import Case
from pepper_drake.diagrams.factory import make_coupling, make_primitive, prepare_scene
from pepper_drake.diagrams.ground_truth import measure_cloud
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.learning import PointCloudDistance
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.models.random_scene import random_scene
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.mapping.cloud_points import make_cloud
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.differential_ik import hand_key
from pepper_drake.planning.reach.kinematic_simulation import ArmState, KinematicSimulator
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import (
    PlanningLatency,
    ReachPlannerParams,
    ReachTiming,
)
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_state import ReachState
from pepper_drake.planning.reach.swept_space import UnseenSpaceParams
from pepper_drake.planning.reach.task_sequence import SequenceTask
from pepper_drake.scenario import build_reaching


def make_reaching(name, arm, *, lifts=False):
    scene = prepare_scene(load_scene(name), arm=arm)
    coupling, primitive = make_coupling(scene.coupling), make_primitive(None, scene.arm)
    wait, lift = (
        SequenceTask("wait", wait=0.2),
        SequenceTask("lift", primitive, offset=(0, 0, 0.06)),
    )
    config = ReachingConfig(tasks=(wait, lift) if lifts else ())
    return Reaching(scene, primitive, coupling, config)


def plain(value, key):
    """A port's value in a form that compares, or None for what is only handed on."""
    if isinstance(value, np.ndarray):
        return value
    if isinstance(value, RigidTransform):
        return value.GetAsMatrix34()
    if isinstance(value, PointCloud):
        return value.xyzs().copy()
    if isinstance(value, BusValue):
        return value.Find(key).GetAsMatrix34()
    if hasattr(value, "data") and isinstance(value.data, np.ndarray):
        return value.data.copy()
    return None


def outputs(reaching, root):
    """Every comparable output of every system of the loop, the station among them."""
    values = {}
    for system in reaching.GetSystems():
        context = system.GetMyContextFromRoot(root)
        for k in range(system.num_output_ports()):
            port = system.get_output_port(k)
            if port.get_data_type() == PortDataType.kAbstractValued and "query" in port.get_name():
                continue
            value = plain(port.Eval(context), hand_key(reaching.scene.arm))
            if value is not None:
                values[system.get_name(), port.get_name()] = np.array(value)
    return values


@pytest.mark.render
def test_a_whole_reach_with_the_left_arm_in_which_no_cached_value_is_ever_stale():
    reaching = make_reaching("table", "left", lifts=True)
    run = ReachSimulation(reaching, RunOptions(progress=False))
    checked = dict.fromkeys(ReachMode, 0)
    last = -1.0

    def check(root):
        # Once a second: what the caches say against what a computation without them says.
        nonlocal last
        if root.get_time() - last < 0.97:
            return
        last = root.get_time()
        cached = outputs(reaching, root)
        root.SetAllCacheEntriesOutOfDate()
        for port, value in outputs(reaching, root).items():
            np.testing.assert_array_equal(cached[port], value, err_msg=str(port))
        checked[run.mode()] += 1

    run.simulator.set_monitor(check)
    report = run.run().report
    assert (report.outcome, report.reason) == ("reached", "")
    assert report.arm == "left"
    assert report.contacts == 0
    assert report.minimum_clearance > 0
    assert report.final_position_error <= 0.010
    assert checked[ReachMode.LOOKING] >= 1
    assert checked[ReachMode.REACHING] >= 2
    reach, wait, lift = report.tasks
    assert [reach.name, wait.name, lift.name] == ["reach", "wait", "lift"]
    assert max(task.final_position_error for task in report.tasks) <= 0.010
    assert wait.seconds == pytest.approx(0.2, abs=0.06)
    hand = np.array(run._true_goal_rows())[:, 2]
    times = run.reaching.logs["mode"].FindLog(run.simulator.get_context()).sample_times()
    before = hand[np.searchsorted(times, lift.began)]
    assert hand[-1] - before == pytest.approx(0.06, abs=0.005)


@pytest.mark.render
@pytest.mark.parametrize(
    ("latency", "ticks_checked", "bound"),
    # Without latency all of the retreat is as it was simulated; with it the cloud that bends it is
    # a newer one, but it starts where it was predicted to.
    [(PlanningLatency(0.0, 0.0, 0.0), 1000, 0.05), (PlanningLatency(), 1, 0.02)],
)
def test_an_arm_retreats_as_it_was_simulated_and_reaches_when_the_path_is_free(
    latency, ticks_checked, bound, monkeypatch
):
    scene = random_scene(2000, moving=True)  # A person's arm comes to the goal, and goes.
    config = ReachingConfig(
        station=StationConfig(seed=2000, obstacle_motion_ports=True),
        timing=ReachTiming(latency=latency),
        # A look at what was not seen would let the person's arm go by.
        planner=ReachPlannerParams(unseen=UnseenSpaceParams(allow_motion=True)),
    )
    coupling = make_coupling(scene.coupling)
    reaching = Reaching(scene, make_primitive(None, scene.arm), coupling, config)
    run = ReachSimulation(reaching, RunOptions(progress=False))
    retreats = []
    retreat = reaching.planner.plan_retreat

    def retreat_and_note(travelled, observation):
        retreats.append(retreat(travelled, observation))
        return retreats[-1]

    monkeypatch.setattr(reaching.planner, "plan_retreat", retreat_and_note)
    off = []

    def check(root):
        if not retreats or (len(retreats) > 1 and latency.plan == 0.0):
            return
        # An arm that brakes stands before the retreat begins, whatever the latency.
        state, plan = reaching.supervisor.progress(supervisor), retreats[0]
        if state.plan is not plan:
            return
        ticks = round((root.get_time() - state.since) / config.ik.time_step)
        if 1 <= ticks <= min(len(plan.joint_path) - 1, ticks_checked):
            context = reaching.controller.GetMyContextFromRoot(root)
            command = reaching.controller.GetOutputPort("position_command").Eval(context)
            # A command is one tick older or younger, at up to 2 rad/s.
            near = plan.joint_path[max(ticks - 1, 0) : ticks + 2]
            off.append(np.abs(near - command).max(axis=1).min())

    supervisor = reaching.supervisor.GetMyContextFromRoot(run.simulator.get_context())
    run.simulator.set_monitor(check)
    report = run.run().report
    assert (report.outcome, report.contacts) == ("reached", 0)
    assert len(off) >= min(20, ticks_checked)
    assert max(off) < bound


@pytest.mark.render
def test_a_low_goal_is_reached_and_confirmed_by_a_robot_that_leans_forward():
    reaching = build_reaching(Case(105, family="low_table").scenario())
    result = ReachSimulation(reaching, RunOptions(progress=False)).run()
    report, log = result.report, result.log
    assert (report.outcome, report.contacts) == ("reached", 0)
    assert report.final_position_error < 0.01
    hip = log.joint_position_rad[:, BODY_JOINTS.index("HipPitch")]
    assert hip[-1] == pytest.approx(-0.3, abs=0.02)
    assert np.abs(np.diff(hip) / np.diff(log.time_s)).max() < 0.35


@pytest.mark.render
def test_a_goal_that_is_moved_out_of_reach_is_followed_by_the_whole_robot(tmp_path):
    motion = tmp_path / "aside.txt"
    motion.write_text("0.5 0 0 0\n2.5 0 0.3 0\n")  # 30 cm in 2 s, while the arm reaches.
    reaching = build_reaching(Case(0, scene="table", goal_motion=str(motion)).scenario())
    result = ReachSimulation(reaching, RunOptions(progress=False)).run()
    report, log = result.report, result.log
    assert (report.outcome, report.reason, report.contacts) == ("reached", "", 0)
    assert report.final_position_error < 0.01
    assert report.movement.returns == 1
    first = int(np.argmax(log.mode == ReachMode.REACHING))
    assert np.linalg.norm((log.base_pose_m_m_rad[-1] - log.base_pose_m_m_rad[first])[:2]) > 0.2


@pytest.mark.render
def test_a_clone_does_not_know_what_becomes_of_the_original():
    reaching = make_reaching("free", "right")
    simulator = Simulator(reaching)
    context = simulator.get_mutable_context()
    simulator.AdvanceTo(0.5)
    clone = context.Clone()
    before = outputs(reaching, clone)
    simulator.AdvanceTo(1.0)
    clone.SetAllCacheEntriesOutOfDate()
    after, original = outputs(reaching, clone), outputs(reaching, context)
    for port, value in before.items():
        np.testing.assert_array_equal(after[port], value, err_msg=str(port))
    moved = {port for port, value in original.items() if not np.array_equal(value, before[port])}
    assert ("station", "joint_position") in moved
    # From the same state the same follows.
    other = Simulator(reaching, clone)
    other.Initialize(InitializeParams(suppress_initialization_events=True))
    other.AdvanceTo(1.0)
    for port, value in outputs(reaching, clone).items():
        np.testing.assert_array_equal(value, original[port], err_msg=str(port))


def test_a_cloud_is_measured_against_the_true_surfaces():
    scene = load_scene("free")
    station = PepperStation(scene, StationConfig(cameras=False), shared_control_model())
    context = station.CreateDefaultContext()
    query = station.GetOutputPort("ground_truth.query").Eval(context)
    tray = scene.obstacles[0]
    top = np.add(tray.position, [0, 0.05, tray.size[2] / 2])
    on, above, below = top, np.add(top, [0, 0, 0.01]), np.add(top, [0, 0, -0.004])
    report = measure_cloud(station, query, np.array([on]))
    assert (report.points, report.robot_points, report.goal_points) == (1, 0, 0)
    assert report.rms_error == pytest.approx(0, abs=1e-9)
    report = measure_cloud(station, query, np.array([above, below]))
    assert report.rms_error == pytest.approx(np.sqrt((0.01**2 + 0.004**2) / 2), rel=1e-6)

    goal = np.add(scene.goal.position, [0, 0, 0.1])
    torso = station.GetOutputPort("torso_pose").Eval(context).translation()
    report = measure_cloud(station, query, np.array([on, goal, goal, torso]))
    assert (report.points, report.robot_points, report.goal_points) == (4, 1, 2)
    assert measure_cloud(station, query, np.zeros((0, 3))).rms_error is None


def test_a_solver_that_gives_up_is_an_outcome_and_not_a_traceback(monkeypatch):
    scene = load_scene("free")
    reaching = Reaching(scene, make_primitive(None, scene.arm), None, ReachingConfig())
    run = ReachSimulation(reaching, RunOptions(progress=False))
    run.simulator.AdvanceTo(0.05)

    def give_up(context):
        raise RuntimeError("The SAP solver failed to converge.\nMore about it.")

    monkeypatch.setattr(reaching.supervisor, "observe", give_up)
    report = run.run().report
    assert report.outcome == "failed"
    assert report.reason == "simulation_failed"
    assert report.message.endswith("The SAP solver failed to converge. More about it.")


def test_the_safety_monitor_hears_how_near_the_arm_is_only_where_a_coupling_is_vetted():
    scene = load_scene("free")
    for coupling, collision_checked, hears in (("barrier", True, True), ("report", False, False)):
        config = ReachingConfig()
        config.planner.collision_checked = collision_checked
        primitive = make_primitive(None, scene.arm)
        reaching = Reaching(scene, primitive, make_coupling(coupling), config)
        port = reaching.safety.GetSubsystemByName("safety_monitor").GetInputPort("clearance")
        assert (
            port.HasValue(port.get_system().GetMyContextFromRoot(reaching.CreateDefaultContext()))
            == hears
        )


def test_only_what_the_robot_itself_goes_near_to_stops_it():
    reaching = make_reaching("free", "right")
    safety, supervisor = reaching.safety, reaching.supervisor
    part = safety.GetSubsystemByName
    monitor, arm_watch, body_watch = map(part, ("safety_monitor", "arm_watch", "body_watch"))
    sources = safety.connection_map()
    for watch, name in ((body_watch, "body_clearance"), (arm_watch, "clearance")):
        heard = monitor.GetInputPort(name).get_index()
        port = watch.GetOutputPort("approach_clearance").get_index()
        assert sources[monitor, heard] == (watch, port)
    heard = supervisor.GetInputPort("predicted_clearance").get_index()
    exported = safety.GetOutputPort("predicted_clearance").get_index()
    assert reaching.connection_map()[supervisor, heard] == (safety, exported)
    port = arm_watch.GetOutputPort("predicted_approach_clearance").get_index()
    assert safety.get_output_port_locator(exported) == (arm_watch, port)


def test_the_planners_simulation_gives_the_whole_diagrams_commands():
    """From the plan to what the safety monitor lets pass; the scene is held still."""
    reaching = make_reaching("free", "right")
    primitive, time_step = reaching.primitive, reaching.config.ik.time_step
    X_TG = RigidTransform(Quaternion(primitive.orientation.goal), primitive.goal)
    # Beside the path, where they bend it; a cloud is in single precision.
    middle = primitive.rollout().positions[100]
    points = (middle + [[0.02, 0.05, -0.06], [0.04, 0.06, -0.05]]).astype(np.float32).astype(float)
    movement = Movement(primitive, make_coupling("barrier"))
    simulator = Simulator(reaching)
    root = simulator.get_mutable_context()

    def fix(system, **values):
        for name, value in values.items():
            context = system.GetMyMutableContextFromRoot(root)
            system.GetInputPort(name).FixValue(context, value)

    cloud = Value(make_cloud(points))
    torso = reaching.station.GetOutputPort("torso_pose")
    X_WT = RigidTransform(torso.Eval(reaching.station.GetMyContextFromRoot(root)))
    fix(reaching.controller, object_pose=X_WT @ X_TG, torso_pose=X_WT, cloud=cloud)
    supervisor = reaching.supervisor.GetMyMutableContextFromRoot(root)
    plan = ReachPlan(PlanStatus.CLEAR, "", np.zeros(3), movement=movement)
    reaching_now = ReachState(mode=ReachMode.REACHING, plan=plan, movements=1, started=0.0)
    supervisor.get_mutable_abstract_state(0).set_value(reaching_now)
    simulator.Initialize()
    arm = body_indices(arm_joints("right"))
    safety = reaching.safety.GetMyContextFromRoot(root)
    start = ArmState(reaching.command.Eval(safety)[arm], np.zeros(5))
    found = [start.position]
    for tick in range(60):
        # The cameras tell nothing in this short time that the supervisor would wait for.
        fix(reaching.supervisor, goal_age=[0.0], cloud_time=[root.get_time()])
        simulator.AdvanceTo((tick + 0.5) * time_step)
        found.append(reaching.command.Eval(safety)[arm])
    progress = reaching.supervisor.progress(supervisor)
    assert (progress.mode, progress.reason) == (ReachMode.REACHING, "")

    kinematics = arm_kinematics(reaching.station.control_model, "right")
    offline = KinematicSimulator(
        reaching.station.control_model, kinematics, reaching.config.ik, settle=0.4, still_speed=0.02
    )
    field = PointCloudDistance(points)
    expected = offline.track(start, offline.roll_out(movement, start, X_TG, field), 1e-9)
    np.testing.assert_allclose(found, expected[: len(found)], rtol=0.0, atol=1e-9)
    assert np.abs(found[-1] - found[0]).max() > 0.5
    alone = offline.roll_out(replace(movement, coupling=None), start, X_TG, field)
    assert np.abs(offline.track(start, alone, 1e-9)[: len(found)] - found).max() > 0.1
