"""Simulates one reach and measures it against the ground truth."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
import numpy.typing as npt
from pydrake.geometry import (
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
)
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from pepper_drake.diagrams.ground_truth import measure_cloud
from pepper_drake.diagrams.reach_drawing import draw_cloud, draw_paths, frame_view
from pepper_drake.diagrams.reach_result import ReachResult
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.simulate import simulate
from pepper_drake.diagrams.task_outcomes import task_outcomes
from pepper_drake.diagrams.taught_movement import explain_adaptation, taught_path
from pepper_drake.diagrams.touch_report import arm_speed, stopping_time, touch_speed
from pepper_drake.diagrams.verdict import RunEnd, judge
from pepper_drake.models.control_model import arm_joints, body_indices
from pepper_drake.models.pepper import JOINT_GROUPS, hand_frame
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.task_sequence import SequenceState
from pepper_drake.results.movement_report import measure_movement
from pepper_drake.results.reach_log import ReachLog
from pepper_drake.results.reach_report import CloudReport, ReachReport, pose_error
from pepper_drake.systems.framework import Diagram, build

Vector = npt.NDArray[np.float64]

_AFTERMATH = 1.5
"""Simulated time after a failure, to measure how the robot stops [s]."""


@dataclass
class RunOptions:
    """Display and interruption of a run."""

    meshcat: Meshcat | None = None
    """Meshcat for the visualization; None for none."""
    record: bool = False
    """True to keep the run in meshcat for `recording.html`."""
    realtime: bool = False
    """True to run no faster than real time."""
    progress: bool = True
    """True to show a progress bar."""
    should_stop: Callable[[], bool] = lambda: False
    """Polled every 0.1 s of simulated time; ends the run in an orderly way."""
    keep: Callable[[ReachResult], None] | None = None
    """Receives the result so far about once a second, in case the program is killed."""


class ReachSimulation:
    """Simulates a `Reaching` diagram to its end and measures it against the ground truth.

    Attributes:
        reaching: The diagram.
        simulator: Simulator of the diagram, with its visualizer if there is one.
    """

    def __init__(self, reaching: Reaching, options: RunOptions) -> None:
        self.reaching, self._options = reaching, options
        system: Diagram = reaching
        self._visualizer: MeshcatVisualizer | None = None
        if options.meshcat is not None:
            frame_view(options.meshcat, reaching.scene)
            builder = DiagramBuilder()
            builder.AddSystem(reaching)
            self._visualizer = MeshcatVisualizer(
                options.meshcat, MeshcatVisualizerParams(publish_period=1 / 32)
            )
            builder.AddNamedSystem("visualizer", self._visualizer)
            builder.Connect(
                reaching.GetOutputPort("ground_truth.query"),
                self._visualizer.query_object_input_port(),
            )
            system = build(builder)
        self.simulator = Simulator(system)
        self.simulator.set_target_realtime_rate(1.0 if options.realtime else 0.0)
        self._fault = ""
        self._longest = reaching.config.timing.longest * (1 + len(reaching.config.tasks))
        self._is_over = False
        self._true_rows: list[list[float]] = []
        self._cloud_W: Vector = np.zeros((0, 3))
        self._cloud_T: Vector = np.zeros((0, 3))
        self._cloud_report = CloudReport()
        self._planned_with: Observation | None = None

    @property
    def context(self) -> Context:
        """The reaching diagram's context."""
        return self.reaching.GetMyContextFromRoot(self.simulator.get_context())

    def mode(self) -> ReachMode:
        """Returns the supervisor's present mode."""
        reaching = self.reaching
        return reaching.supervisor.progress(
            reaching.supervisor.GetMyContextFromRoot(self.simulator.get_context())
        ).mode

    def final_positions(self) -> tuple[Vector, Vector]:
        """Returns the station plant's present positions and the base's x, y, yaw."""
        station, root = self.reaching.station, self.simulator.get_context()
        positions = station.plant.GetPositions(station.plant.GetMyContextFromRoot(root))
        base = station.GetOutputPort("base_pose").Eval(station.GetMyContextFromRoot(root))
        return positions, base

    def run(self) -> ReachResult:
        """Runs until the reach is done or has failed."""
        options = self._options
        self.simulator.Initialize()
        if self.reaching.station.renderer is not None:
            self.reaching.station.renderer.wait_until_ready()
        if self._visualizer is not None and options.record:
            self._visualizer.StartRecording(False)
        began, mode, failed = time.perf_counter(), ReachMode.LOOKING, np.inf

        def watch() -> bool:
            nonlocal mode, failed
            previous, mode = mode, self.mode()
            if mode == ReachMode.REACHING and previous != mode:
                self._look_at_cloud()
            now = self.simulator.get_context().get_time()
            if mode == ReachMode.FAILED and previous != mode:
                failed = now
            done = mode == ReachMode.DONE and self._sequence().finished
            return done or now >= failed + _AFTERMATH

        def keep() -> None:
            if options.keep is not None:
                options.keep(self._result(time.perf_counter() - began))

        end = simulate(
            self.simulator,
            self._longest,
            watch=watch,
            should_stop=options.should_stop,
            keep=keep,
            progress=options.progress,
            title=lambda: mode.name.lower(),
        )
        self._fault, wall = end.fault, end.wall_seconds
        self._is_over = not end.stopped
        self._draw_paths()
        html = None
        if self._visualizer is not None and options.record:
            assert options.meshcat is not None
            self._visualizer.StopRecording()
            self._visualizer.PublishRecording()
            html = options.meshcat.StaticHtml()
        return self._result(wall, html)

    def _result(self, wall: float, html: str | None = None) -> ReachResult:
        """Returns the result of the run so far."""
        log = self._log()
        return ReachResult(self.reaching.scene, self._report(log, wall), log, html)

    def _look_at_cloud(self) -> None:
        """Measures and draws the cloud at the start of the arm's motion."""
        reaching, context = self.reaching, self.context
        root = self.simulator.get_context()
        supervisor = reaching.supervisor
        state = supervisor.progress(supervisor.GetMyContextFromRoot(root))
        self._planned_with = state.planned_with
        perception = reaching.perception
        seen = perception.GetMyContextFromRoot(self.simulator.get_context())
        self._cloud_W = cloud_points(perception.GetOutputPort("cloud").Eval(seen))
        self._cloud_T = cloud_points(perception.GetOutputPort("cloud_torso").Eval(seen))
        query = reaching.GetOutputPort("ground_truth.query").Eval(context)
        self._cloud_report = measure_cloud(reaching.station, query, self._cloud_W)
        if self._options.meshcat is not None:
            draw_cloud(self._options.meshcat, self._cloud_W)

    def states(self) -> Vector:
        """Returns the logged states (N, n) of the station's plant."""
        return self._rows("state")

    def _rows(self, name: str) -> Vector:
        """Returns the logged rows (N, n) of one signal."""
        log = self.reaching.logs[name].FindLog(self.simulator.get_context())
        return np.asarray(log.data()).T

    def _log(self) -> ReachLog:
        reaching = self.reaching
        times = self.reaching.logs["mode"].FindLog(self.simulator.get_context()).sample_times()
        tau = self._rows("tau")[:, 0]
        coupling = self._rows("coupling") / tau[:, None] ** 2
        mode = self._rows("mode")[:, 0].astype(np.int64)
        origin = self._rows("movement_origin")[:, 0].astype(np.int64)
        true = self._true_goal_rows()
        hand, goal = self._rows("hand_position"), self._rows("goal_position")
        return ReachLog(
            time_s=np.asarray(times),
            mode=mode,
            movement_origin=origin,
            joint_position_rad=self._rows("joint_position"),
            joint_command_rad=self._rows("joint_command"),
            base_pose_m_m_rad=self._rows("base_pose"),
            hand_opening=self._rows("hand_opening"),
            object_offset_m=self._object_offsets(),
            hand_position_torso_m=hand,
            desired_position_torso_m=self._rows("desired_position"),
            goal_position_torso_m=goal,
            goal_distance_m=true[:, 3],
            orientation_error_rad=true[:, 4],
            axis_error_rad=true[:, 5],
            phase=self._rows("phase")[:, 0],
            tau_s=tau,
            coupling_m_per_s2=coupling,
            clearance_m=self._rows("clearance")[:, 0],
            seen_clearance_m=np.minimum(self._rows("seen_clearance")[:, 0], 0.1),
            cloud_torso_m=self._cloud_T,
            demonstration_m=reaching.planner.demonstrated_path(),
            taught_path_torso_m=taught_path(
                self.reaching.planner.demonstrated.primitive,
                np.asarray(times),
                mode,
                origin,
                hand,
                goal,
            ),
        )

    def _object_offsets(self) -> Vector:
        """Returns the offsets (N, 3 K) [m] of the K moving objects from their scene poses."""
        station = self.reaching.station
        columns = [
            station.plant.GetJointByName(f"{moving.name}_{axis}").position_start()
            for moving in station.scene_models.moving
            for axis in "xyz"
        ]
        return self.states()[:, columns]

    def _sequence(self) -> SequenceState:
        """Returns the progress in the tasks; that of a reach without tasks is finished."""
        sequencer, scene = self.reaching.sequencer, self.reaching.scene
        if sequencer is None:
            return SequenceState(goals=(scene.pre_grasp(),), finished=True)
        return sequencer.progress(sequencer.GetMyContextFromRoot(self.simulator.get_context()))

    def _tasks(self) -> npt.NDArray[np.int64]:
        """Returns the task number of each logged row (N,)."""
        if self.reaching.sequencer is None:
            return np.zeros(len(self._rows("mode")), dtype=np.int64)
        return self._rows("task")[:, 0].astype(np.int64)

    def _true_poses(
        self, plant_context: Context, X_OG: RigidTransform
    ) -> tuple[RigidTransform, RigidTransform]:
        """Returns the true poses of the hand and its goal in W."""
        station, scene = self.reaching.station, self.reaching.scene
        X_WH = station.plant.GetFrameByName(hand_frame(scene.arm)).CalcPoseInWorld(plant_context)
        X_WO = station.plant.EvalBodyPoseInWorld(
            plant_context, station.plant.GetBodyByName(station.scene_models.goal_object)
        )
        return X_WH, X_WO @ X_OG

    def _true_goal_rows(self) -> Vector:
        """Returns true hand position in W, distance to the goal [m] and two angles [rad] (N, 6).

        The angles are between their orientations, and between the axes that the task constrains.
        """
        plant = self.reaching.station.plant
        plant_context = plant.CreateDefaultContext()
        task = self.reaching.scene.goal.pre_grasp
        known, goals = len(self._true_rows), self._sequence().goals
        for state, number in zip(self.states()[known:], self._tasks()[known:], strict=True):
            plant.SetPositionsAndVelocities(plant_context, state)
            X_WH, X_WG = self._true_poses(plant_context, goals[number])
            distance, angle = pose_error(X_WH, X_WG)
            axis = task.axis_error(X_WH.rotation().inverse() @ X_WG.rotation())
            self._true_rows.append([*X_WH.translation(), distance, angle, axis])
        return np.array(self._true_rows).reshape(-1, 6)

    def _draw_paths(self) -> None:
        """Draws the hand's path and the demonstrated one."""
        moving = np.isin(self._rows("mode")[:, 0], (ReachMode.REACHING, ReachMode.HOLDING))
        if self._options.meshcat is None or not np.any(moving):
            return
        hand_W = self._true_goal_rows()[moving, :3]
        station = self.reaching.station
        X_WT = station.GetOutputPort("torso_pose").Eval(
            station.GetMyContextFromRoot(self.simulator.get_context())
        )
        shown = self.reaching.planner.demonstrated_path()
        shown_W = (shown - shown[0]) @ X_WT.rotation().matrix().T + hand_W[0]
        draw_paths(self._options.meshcat, hand_W, shown_W)

    def _report(self, log: ReachLog, wall: float) -> ReachReport:
        reaching, root = self.reaching, self.simulator.get_context()
        scene, station = reaching.scene, reaching.station
        progress = reaching.supervisor.progress(reaching.supervisor.GetMyContextFromRoot(root))
        X_OG = self._sequence().goals[-1]
        X_WH, X_WG = self._true_poses(station.plant.GetMyContextFromRoot(root), X_OG)
        is_coupled = reaching.planner.demonstrated.coupling is not None
        report = ReachReport(
            scene=scene.name,
            arm=scene.arm,
            coupling=scene.coupling if is_coupled else "none",
            seed=reaching.config.station.seed,
            cloud=self._cloud_report,
            simulated_seconds=root.get_time(),
            wall_seconds=wall,
            realtime_factor=root.get_time() / wall,
            minimum_clearance=float(log.clearance_m.min()),
            contacts=int(np.count_nonzero(log.clearance_m[::2] <= 0.0)),
            versions={name: version(name) for name in ("pepper-drake", "drake", "numpy")},
        )
        if np.isfinite(progress.started):
            arrived, started = progress.arrived, progress.started
            report.planning_seconds = reaching.timed_planner.seconds(arrived, started)
            report.planning_delay = started - arrived - reaching.config.timing.settling
        if progress.plan is not None:
            cell = reaching.config.planner.unseen.cell
            report.unseen_volume = len(progress.plan.unseen) * cell**3
            report.out_of_view_volume = progress.plan.out_of_view
        if progress.placement is not None:
            report.drive_out_of_view_volume = progress.placement.out_of_view
        report.closest_pair = self._closest_pair(log)
        report.final_position_error, report.final_orientation_error = pose_error(X_WH, X_WG)
        report.final_axis_error = float(log.axis_error_rad[-1])
        report.axis_tolerance = scene.goal.pre_grasp.tolerance
        report.movement = measure_movement(log)
        if self._is_over:
            started = int(np.argmax(log.time_s >= progress.started))
            explain_adaptation(
                report.movement,
                reaching,
                self._planned_with,
                root.Clone(),
                self.states()[started],
            )
        perception = reaching.perception
        seen = perception.GetMyContextFromRoot(root)
        if perception.GetOutputPort("goal_valid").Eval(seen)[0]:
            X_WO = perception.GetOutputPort("object_pose").Eval(seen)
            report.goal_estimate_error, _ = pose_error(X_WO @ X_OG, X_WG)
        moving = np.isin(log.mode, (ReachMode.REACHING, ReachMode.HOLDING))
        if np.any(moving):
            error = log.hand_position_torso_m[moving] - log.desired_position_torso_m[moving]
            report.tracking_error_rms = float(np.sqrt(np.mean(np.sum(error**2, axis=1))))
        names = ["reach", *(task.name for task in reaching.config.tasks)]
        report.tasks = task_outcomes(names, self._tasks(), log)
        self._measure_motion(report, log)
        end = RunEnd(progress.mode, progress.reason, progress.message, self._fault, self._is_over)
        judge(report, end, reaching.config.planner.tolerance, self._longest)
        return report

    def _measure_motion(self, report: ReachReport, log: ReachLog) -> None:
        """Fills in speeds, forces and the stopping time."""
        reaching, times = self.reaching, log.time_s
        if len(times) < 4:
            return
        root = self.simulator.get_context().Clone()
        station = reaching.station
        touch = touch_speed(
            station,
            station.GetMyMutableContextFromRoot(root),
            self.states(),
            log.clearance_m,
        )
        if touch is not None:
            report.touch_speed, report.own_touch_speed = touch.relative, touch.own
        forces = self._rows("contact_force").max(axis=0)
        report.contact_force, report.goal_force = float(forces[0]), float(forces[1])
        arm = body_indices(arm_joints(reaching.scene.arm))
        step = float(times[1] - times[0])
        report.arm_speed = arm_speed(
            station.control_model, reaching.scene.arm, log.joint_position_rad[:, arm], step
        )
        period = reaching.config.ik.time_step
        commands = log.joint_command_rad[:: round(period / step)]
        changes = np.abs(np.diff(commands, n=2, axis=0))
        report.command_acceleration = float(changes.max() / period**2)
        failed = np.flatnonzero(log.mode == ReachMode.FAILED)
        if len(failed):
            report.stopping_seconds = stopping_time(
                times,
                log.joint_command_rad[:, len(JOINT_GROUPS["head"]) :],
                log.base_pose_m_m_rad,
                float(times[failed[0]]),
            )
        report.faults = [str(fault) for fault in station.config.faults.faults]

    def _closest_pair(self, log: ReachLog) -> str:
        """Returns the link and the obstacle at the time of the smallest clearance."""
        reaching = self.reaching
        root = self.simulator.get_context().Clone()
        plant = reaching.station.plant
        state = self.states()[int(np.argmin(log.clearance_m))]
        plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), state)
        query = reaching.GetOutputPort("ground_truth.query").Eval(
            reaching.GetMyContextFromRoot(root)
        )
        return reaching.clearance.closest_pair(query)[1]
