"""The simulated Pepper of a live session: its commands and measurements between frames."""

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, System

from pepper_drake.diagrams.factory import make_coupling, make_primitive
from pepper_drake.diagrams.live_teaching import LiveTeaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.simulate import simulate
from pepper_drake.diagrams.taught_movement import simulate_taught
from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling
from pepper_drake.models.movable_objects import (
    SPARES,
    with_movable_objects,
    with_spare_obstacles,
)
from pepper_drake.models.objects import GOAL_OBJECT
from pepper_drake.models.pepper import arm_group
from pepper_drake.models.scene import Scene
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.planner_wrapper import PlannerWrapper
from pepper_drake.planning.reach.reach_mode import ReachCommand
from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.planning.reach.reach_state import ReachState
from pepper_drake.systems.robot.arm_command import ArmMode

Vector = npt.NDArray[np.float64]

PUBLISH_PERIOD = 1 / 32
"""Time between two frames of the page [s]."""
CHECKS = 4
"""Number of times per frame that user input is processed: it waits for at most 8 ms."""


@dataclass(frozen=True)
class SimulationRate:
    """Duration [s] and number of frames of a session, and its speed."""

    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    frames: int = 0

    @property
    def realtime_rate(self) -> float:
        """Simulated time per wall time."""
        return self.simulated_seconds / max(self.wall_seconds, 1e-9)

    @property
    def frames_per_second(self) -> float:
        """Frames per second of wall time."""
        return self.frames / max(self.wall_seconds, 1e-9)


class LiveSimulation:
    """A LiveTeaching diagram and its simulator, advanced frame by frame.

    Attributes:
        diagram: The diagram.
        simulator: Its simulator.
        arm_mode: Source of the arm's motion.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        config: ReachingConfig | None = None,
        movables: Collection[str] = (),
        coupling: str | None = None,
        barrier: BarrierCoupling | None = None,
        spares: bool = False,
        realtime: bool = False,
    ) -> None:
        """Makes the simulation, with Pepper at its place in the scene, its arm limp and held.

        Args:
            scene: Scene with the goal within reach.
            config: Configuration of the robot simulation and of the loop.
            movables: Movable obstacles besides those that have a path in the scene.
            coupling: Name of the obstacle coupling; the scene's if omitted.
            barrier: Constants of the coupling "barrier"; the usual ones if omitted.
            spares: Whether further obstacles can be added to the scene.
            realtime: Whether to run no faster than real time.
        """
        movable = with_movable_objects(scene, movables)
        self.diagram = LiveTeaching(
            with_spare_obstacles(movable) if spares else movable,
            make_primitive(None, scene.arm),
            make_coupling(coupling or scene.coupling, barrier),
            config=config,
        )
        self.simulator = Simulator(self.diagram)
        self.arm_mode = ArmMode.LIMP
        self._resets = 0
        self._offsets = {name: np.zeros(3) for name in self.diagram.movables}
        self._guide_velocity = np.zeros(6)
        self._frames = 0
        self._began = time.perf_counter()
        self._fix("arm_mode", [float(self.arm_mode)])
        self._fix("command", [float(ReachCommand.IDLE)])
        self._fix("reset", [0.0])
        self._fix("guide_target", RigidTransform())
        self._fix("guide_velocity", self._guide_velocity)
        self._fix("joint_target", np.zeros(5))
        for name, offset in self._offsets.items():
            self._fix(f"{name}.target", offset)
        self.simulator.set_target_realtime_rate(1.0 if realtime else 0.0)
        self.simulator.Initialize()
        self._take_hand()

    @property
    def scene(self) -> Scene:
        """The scene, with movable objects on prismatic joints."""
        return self.diagram.scene

    @property
    def arm(self) -> str:
        """The taught arm, "left" or "right"."""
        return self.diagram.arm

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.simulator.get_context().get_time())

    @property
    def pace(self) -> SimulationRate:
        """Overall speed since the start."""
        return SimulationRate(self.time, time.perf_counter() - self._began, self._frames)

    def begin(self) -> None:
        """Restarts the real-time clock, so that time lost before is not caught up."""
        self.simulator.ResetStatistics()
        self._began = time.perf_counter()

    def advance(self, attend: Callable[[], None] = lambda: None) -> None:
        """Simulates up to the next frame.

        Args:
            attend: Called at the start and several times in between, to process user input.

        Raises:
            PepperDrakeError: Drake's solver finds no next step.
        """
        for part in range(1, CHECKS + 1):
            attend()
            end = (self._frames + part / CHECKS) * PUBLISH_PERIOD
            simulate(self.simulator, end).check()
        self._frames += 1

    def torso_pose(self) -> RigidTransform:
        """Returns X_WT."""
        return RigidTransform(self._eval(self.diagram.station, "torso_pose"))

    def hand_pose(self) -> RigidTransform:
        """Returns X_TH."""
        return RigidTransform(self._eval(self.diagram.station, f"{self.arm}_hand_pose"))

    def guide_pose(self) -> RigidTransform:
        """Returns X_TG of the guide."""
        X_WG = self._eval(self.diagram.guide, "guide_pose")
        return self.torso_pose().InvertAndCompose(RigidTransform(X_WG))

    def joints(self) -> Vector:
        """Returns the taught arm's joints (5,) [rad]."""
        port = self.diagram.reaching.arm_position
        return np.array(port.Eval(self._context(port.get_system())))

    def samples(self, start: float) -> tuple[Vector, Vector]:
        """Returns the recording since a time [s]: times (N,) from then, samples (N, 12)."""
        times, samples = self.diagram.recorder.samples(self.simulator.get_context())
        recorded = times >= start - 1e-9
        return times[recorded] - start, samples[recorded]

    def goal_position(self) -> Vector:
        """Returns the hand's goal (3,) in T [m]."""
        return np.array(self._eval(self.diagram.reaching.controller, "goal_position"))

    def goal_distance(self) -> float:
        """Returns the distance of the hand to its goal [m]."""
        return float(np.linalg.norm(self.goal_position() - self.hand_pose().translation()))

    def has_arrived(self) -> bool:
        """Tells whether the hand is at its goal."""
        tolerance = self.diagram.reaching.config.planner.tolerance
        return self.goal_distance() <= tolerance.arrive

    def goal_is_seen(self) -> bool:
        """Tells whether Pepper has an estimate of the goal's pose."""
        return bool(self._eval(self.diagram.reaching.perception, "goal_valid")[0])

    def cloud(self) -> Vector:
        """Returns the obstacles that Pepper sees or remembers (P, 3) in W [m]."""
        return cloud_points(self._eval(self.diagram.reaching.perception, "cloud"))

    def tau(self) -> float:
        """Returns the duration of the movement, as extended by the goal so far [s]."""
        return float(self._eval(self.diagram.reaching.controller, "tau")[0])

    def coupling(self) -> Vector:
        """Returns the obstacle coupling's acceleration of the hand C_t / tau² (3,) in T [m/s²]."""
        return np.array(self._eval(self.diagram.reaching.controller, "coupling")) / self.tau() ** 2

    def reach_state(self) -> ReachState:
        """Returns the state of the reach."""
        supervisor = self.diagram.reaching.supervisor
        return supervisor.progress(self._context(supervisor))

    def why_adapted(self) -> str:
        """Returns why the arm does not perform what it learned, as a sentence; empty if it does."""
        supervisor, state = self.diagram.reaching.supervisor, self.reach_state()
        planner, seen = supervisor.planner(self._context(supervisor)), state.started_with
        while isinstance(planner, PlannerWrapper):
            planner = planner.planner
        origin = Origin.NONE if state.movement is None else state.movement.origin
        if origin == Origin.DETOUR:
            return "something came in the way"
        if origin != Origin.ADAPTED or seen is None or not isinstance(planner, ReachPlanner):
            return ""
        return f"as taught, {simulate_taught(planner, seen)[1]}"

    def is_stopped(self) -> bool:
        """Tells whether the safety monitor has stopped the arm since the last reset."""
        return bool(self._eval(self.diagram.reaching.safety, "stop_reason")[0])

    def set_arm_mode(self, mode: ArmMode) -> None:
        """Changes the source of the arm's motion; the arm holds still, and a stop is reset."""
        limp = mode == ArmMode.LIMP
        if limp != (self.arm_mode == ArmMode.LIMP):
            self.diagram.station.set_stiffness(arm_group(self.arm), 0.0 if limp else 1.0)
            if limp:
                self._take_hand()
        self.arm_mode = mode
        self._resets += 1
        self._fix("reset", [float(self._resets)])
        self._fix("arm_mode", [float(mode)])
        self._fix("command", [float(ReachCommand.IDLE)])

    def reach(self) -> None:
        """Starts a reach, beginning with the search for the goal."""
        if self.arm_mode != ArmMode.HAND:
            self.arm_mode = ArmMode.HAND
            self._fix("arm_mode", [float(ArmMode.HAND)])
        self._fix("command", [float(ReachCommand.REACH)])

    def set_guide_target(self, X_TG: RigidTransform) -> None:
        """Sets the guide's target to a pose in T; the guide follows smoothly."""
        self._fix("guide_target", RigidTransform(X_TG))

    def set_guide_velocity(self, velocity: Vector) -> None:
        """Moves the guide with a velocity (6,), angular and linear in T, instead of to a target."""
        if np.any(velocity) or np.any(self._guide_velocity):
            self._guide_velocity = np.array(velocity, dtype=float)
            self._fix("guide_velocity", self._guide_velocity)

    def set_joint_target(self, joints: Vector) -> None:
        """Sets the joint target of the mode JOINTS (5,) [rad]."""
        self._fix("joint_target", joints)

    def set_primitive(self, primitive: MovementPrimitive) -> None:
        """Sets the primitive to perform in a reach."""
        self._fix("primitive", Value[object](primitive))

    def set_offset(self, name: str, offset: Vector) -> None:
        """Moves the goal object or an obstacle to an offset (3,) [m] from its place in the scene.

        Raises:
            InputError: There is nothing of that name that can be moved.
        """
        if name not in self._offsets:
            raise InputError(f'"{name}" cannot be moved; {", ".join(self._offsets)} can')
        if not np.array_equal(self._offsets[name], offset):
            self._offsets[name] = np.array(offset, dtype=float)
            self._fix(f"{name}.target", self._offsets[name])

    def place(self, name: str, offset: Vector) -> None:
        """Moves an object to an offset (3,) [m] at once; `set_offset` does so gradually.

        Raises:
            InputError: There is nothing of that name that can be moved.
        """
        self.set_offset(name, offset)
        mover = self.diagram.GetSubsystemByName(f"{name}_mover")
        rest = np.concatenate((offset, np.zeros(3)))
        mover.GetMyMutableContextFromRoot(self._root).SetDiscreteState(rest)
        plant = self.diagram.station.plant
        context = plant.GetMyMutableContextFromRoot(self._root)
        for axis, value in zip("xyz", offset, strict=True):
            plant.GetJointByName(f"{name}_{axis}").set_translation(context, value)

    def offsets(self) -> dict[str, tuple[float, float, float]]:
        """Returns the target offset [m] of each movable object, by its name."""
        return {name: (o[0], o[1], o[2]) for name, o in self._offsets.items()}

    def restore_offsets(
        self, offsets: Mapping[str, tuple[float, float, float]], *, at_once: bool = False
    ) -> None:
        """Sends all movable objects to their offsets [m], or home if none is given.

        Args:
            offsets: Offsets by name.
            at_once: Whether to move them at once; objects that are added or removed always are.

        Raises:
            InputError: There is no movable object of a name.
        """
        for name in dict.fromkeys([*self._offsets, *offsets]):
            offset = np.array(offsets.get(name, np.zeros(3)))
            appears = name in SPARES and not (offset.any() and self._offsets[name].any())
            (self.place if at_once or appears else self.set_offset)(name, offset)

    def position(self, name: str) -> Vector:
        """Returns the target position of a movable object (3,) in W [m]."""
        if name == GOAL_OBJECT:
            start = self.scene.goal.position
        else:
            start = next(o.position for o in self.scene.obstacles if o.name == name)
        return np.asarray(start) + self._offsets[name]

    def offset(self, name: str) -> Vector:
        """Returns the target offset of a movable object (3,) [m]."""
        return self._offsets[name].copy()

    def query(self) -> QueryObject:
        """Returns the query object of the scene's geometry."""
        return self.diagram.GetOutputPort("ground_truth.query").Eval(self.simulator.get_context())

    def phase(self) -> float:
        """Returns the movement's phase, 1 at its start and towards 0 at its end."""
        return float(self._eval(self.diagram.reaching.controller, "phase")[0])

    def clearance(self) -> float:
        """Returns the arm's clearance to the obstacles that Pepper sees [m]; infinite at rest."""
        return float(self._eval(self.diagram.reaching.safety, "clearance")[0])

    def camera_picture(self) -> tuple[str, npt.NDArray[np.uint8]] | None:
        """Returns the head camera in use and its picture (H, W, 3); None without cameras."""
        perception = self.diagram.reaching.perception
        if not self.diagram.station.config.cameras:
            return None
        for camera in ("camera_bottom", "camera_top"):
            if self._eval(perception, f"{camera}.enabled")[0]:
                image = self._eval(self.diagram.station, f"{camera}.image").data
                return (camera, image[..., :3].copy()) if image.size else None
        return None

    def camera_pose(self) -> RigidTransform:
        """Returns X_WC of the head's bottom camera: x right, y down, z ahead."""
        frame = self.diagram.station.plant.GetFrameByName("CameraBottom_optical_frame")
        plant = self.diagram.station.plant
        return frame.CalcPoseInWorld(plant.GetMyContextFromRoot(self._root))

    def _take_hand(self) -> None:
        """Lets the guide hold the hand in its present pose."""
        self.set_guide_target(self.hand_pose())
        self.set_guide_velocity(np.zeros(6))

    @property
    def _root(self) -> Context:
        return self.simulator.get_mutable_context()

    def _context(self, system: System) -> Context:
        return system.GetMyContextFromRoot(self._root)

    def _fix(self, port: str, value: object) -> None:
        self.diagram.GetInputPort(port).FixValue(self._root, value)

    def _eval(self, system: System, port: str) -> Any:
        return system.GetOutputPort(port).Eval(self._context(system))
