"""The simulator's process: a `PepperStation` advanced in real time in steps of 20 ms.

It follows the newest command in shared memory, and publishes states and images there. If the
machine is too slow, the robot's clock slows down with the simulation, so that all time stamps
agree.
"""

import math
import signal
import time
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.geometry import QueryObject
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.movable_objects import with_movable_objects
from pepper_drake.models.objects import GOAL_OBJECT
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.scene import Scene
from pepper_drake.naoqi.constants import BOTTOM, CYCLE, DEPTH, HANDS, JOINTS, TOP
from pepper_drake.robot_server.robot.led_hand import LedHand
from pepper_drake.robot_server.robot.range_sensors import MEASURED, PERIOD, RangeSensors
from pepper_drake.robot_server.robot.robot_port import SENSORS
from pepper_drake.robot_server.robot.shared_state import SharedNames, SharedRecord
from pepper_drake.signals import end_with_parent
from pepper_drake.systems.robot.reference_filter import step_follower
from pepper_drake.systems.sensing.camera_model import Frame

CAMERAS = {TOP: "camera_top", BOTTOM: "camera_bottom", DEPTH: "camera_depth"}
LARGEST_IMAGE = 1280 * 960 * 4
"""Size of an image's buffer [bytes]."""
SLOWEST_SHOWN = 0.98
"""Rate of the robot's clock below which it is reported as slow."""
LATENCY = 0.9
"""Latency of an image as a share of its period: meanwhile it may be rendered in parallel with the
simulation, which need not wait."""
_LIMP_JOINTS = tuple(
    name for group in ("head", "left_arm", "right_arm") for name in JOINT_GROUPS[group]
)
"""Joints that can go limp; wheels and leg are always stiff, or Pepper would fall."""
_GOAL_MOTION = {"time_constant": 0.2, "max_speed": 0.2}
"""Smooth motion of a goal that somebody moves: time constant [s] and largest speed [m/s]."""
_LEADING_STEP = 0.005
"""Time for which a person's force at a hand is held [s]."""
_HAND_ROWS = [JOINTS.index(name) for name in HANDS]
_MOTORS = {
    "Yaw": (27.5e-3, 101.3),
    "ShoulderPitch": (27.5e-3, 101.3),
    "HeadPitch": (19.2e-3, 118.1),
    "Roll": (19.2e-3, 118.1),
    "WristYaw": (21.2e-3, 50.61),
    "HipRoll": (47.5e-3, 108.33),
    "HipPitch": (36.9e-3, 108.33),
    "KneePitch": (36.9e-3, 108.33),
}
"""Torque constant [N m/A] and gear ratio by suffix of the joint's name; the longest counts."""
_PALMS = {"l_wrist": "LHand/Touch/Back", "r_wrist": "RHand/Touch/Back"}

STATE = np.dtype(
    [
        ("time", "f8"),
        ("positions", "f8", len(JOINTS)),
        ("velocities", "f8", len(JOINTS)),
        ("base_pose", "f8", 3),
        ("base_velocity", "f8", 3),
        ("currents", "f8", len(JOINTS)),
        ("ranges", "f8", len(MEASURED)),
        ("touched", "?", len(SENSORS)),
        ("contacts", "i8"),
        ("rate", "f8"),
        ("left_hand", "f8", 3),
        ("right_hand", "f8", 3),
        ("goal", "f8", 3),
        ("failed", "U200"),
    ]
)
"""Newest state; hands and goal are the true positions in W [m]."""
COMMAND = np.dtype(
    [
        ("positions", "f8", len(JOINTS)),
        ("stiffnesses", "f8", len(JOINTS)),
        ("base_velocity", "f8", 3),
        ("enabled", "?", len(CAMERAS)),
        ("goal_offset", "f8", 3),
        ("led_arm", "U5"),
        ("led_pose", "f8", 6),
        ("held_sensors", "?", len(SENSORS)),
        ("stop", "?"),
    ]
)
"""Newest command. `led_arm` is the one that a person guides, "" for none, and `led_pose` the target
of its hand: x, y, z, roll, pitch, yaw in T [m, rad], NaN angles for a free orientation."""
IMAGE = np.dtype(
    [("time", "f8"), ("width", "i4"), ("height", "i4"), ("pixels", "u1", LARGEST_IMAGE)]
)


@dataclass(frozen=True)
class SimulatorConfig:
    """Configuration of the served robot.

    Attributes:
        scene: Of the robot.
        station: The simulated robot. With a camera latency below `LATENCY` of the period, the
            robot's clock waits for images in rendering.
        rate: Rate of the robot's clock relative to real time; 0 for as fast as possible.
        epoch: The robot's clock at the start [s since the epoch].
    """

    scene: Scene
    station: StationConfig
    rate: float = 1.0
    epoch: float = 0.0


def simulate(config: SimulatorConfig, names: SharedNames) -> None:
    """Runs until the stop command; the target of the process.

    Args:
        config: Of the robot.
        names: Its shared memory.
    """
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent; it ends this process.
    SimulatedPepper(config, names).run()


class SimulatedPepper:
    """The station with its clock."""

    def __init__(self, config: SimulatorConfig, names: SharedNames) -> None:
        """Builds the station.

        Args:
            config: Of the robot.
            names: Its shared memory.
        """
        self._config = config
        self._state = SharedRecord(STATE, names.state)
        self._command = SharedRecord(COMMAND, names.command)
        self._images = [SharedRecord(IMAGE, name) for name in names.images]
        scene, station_config = config.scene, config.station
        self._goal: npt.NDArray[np.float64] | None = None
        if not scene.goal.path:
            # Somebody may move it, unless it moves by itself.
            scene = replace(with_movable_objects(scene), obstacles=scene.obstacles)
            station_config = replace(station_config, goal_motion_port=True)
            self._goal = np.zeros(6)
        self._station = PepperStation(scene, station_config, shared_control_model())
        self._simulator = Simulator(self._station)
        self._context: Context = self._simulator.get_mutable_context()
        self._rows = [JOINTS.index(name) for name in BODY_JOINTS]
        self._stiffness: dict[str, float] = {}
        self._obeyed = np.zeros(len(JOINTS))
        self._led_hand = LedHand(self._station.plant, _LEADING_STEP)
        self._led_arm, self._led_pose = "", np.zeros(6)
        self._stamps = [-math.inf] * len(CAMERAS)
        self._rendering: list[Frame | None] = [None] * len(CAMERAS)
        plant = self._station.plant
        self._amperes = 1.0 / np.array([np.prod(_motor(name)) for name in BODY_JOINTS])
        places = {
            actuator.joint().name(): actuator.input_start()
            for actuator in map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
        }
        self._motors = [places[name] for name in BODY_JOINTS]
        inspector = self._station.scene_graph.model_inspector()
        self._links = {
            geometry: inspector.GetName(inspector.GetFrameId(geometry)).rpartition("::")[2]
            for geometry in self._station.robot_geometries()
        }
        self._range_sensors = RangeSensors(inspector, self._station.robot_geometries())
        self._scanned = -math.inf

    def run(self) -> None:
        """Advances step by step, in real time if the config has a rate."""
        self._obey(self._measured_as_command())
        self._simulator.Initialize()
        if self._station.renderer is not None:
            self._station.renderer.wait_until_ready()
        self._publish(1.0)
        rate, slice_count = self._config.rate, 0
        begin, shown_rate = time.monotonic(), 1.0
        while not self._command.read()["stop"]:
            if rate > 0.0:
                due = begin + (slice_count + 1) * CYCLE / rate
                early = due - time.monotonic()
                if early > 0.0:
                    time.sleep(early)
                elif early < -CYCLE:
                    begin -= early  # The robot's clock stops for the lateness.
                late = max(-early, 0.0) * rate
                shown_rate += 0.02 * (CYCLE / (CYCLE + late) - shown_rate)
            if self._command.writes > 0:
                self._obey(self._command.read())
            slice_count += 1
            try:
                self._advance_to(slice_count * CYCLE)
            except RuntimeError as error:
                self._state.write(failed=str(error).splitlines()[0][:200])
                return
            self._publish(shown_rate)

    def _advance_to(self, end: float) -> None:
        """Simulates to a time [s]; a person's force is updated in smaller steps."""
        if self._led_arm:
            steps = round(CYCLE / _LEADING_STEP)
            for k in reversed(range(1, steps)):
                self._lead()
                self._simulator.AdvanceTo(end - k * _LEADING_STEP)
            self._lead()
        self._simulator.AdvanceTo(end)

    def _lead(self) -> None:
        """Applies the pull of a person's hand."""
        station, context = self._station, self._context
        force = self._led_hand.step(
            self._led_arm,
            self._led_pose,
            station.GetOutputPort("torso_pose").Eval(context),
            station.GetOutputPort("ground_truth.body_poses").Eval(context),
            station.GetOutputPort("ground_truth.body_velocities").Eval(context),
        )
        station.GetInputPort("applied_forces").FixValue(context, Value([force]))

    def _measured_as_command(self) -> npt.NDArray[np.void]:
        """Returns the command that holds the robot's current posture."""
        command = np.zeros((), COMMAND)
        command["positions"] = self._positions()
        command["stiffnesses"] = 1.0
        return command

    def _positions(self) -> npt.NDArray[np.float64]:
        positions = np.zeros(len(JOINTS))
        positions[self._rows] = self._eval("joint_position")
        positions[_HAND_ROWS] = self._eval("hand_opening")
        return positions

    def _eval(self, port: str) -> npt.NDArray[np.float64]:
        return np.asarray(self._station.GetOutputPort(port).Eval(self._context))

    def _obey(self, command: npt.NDArray[np.void]) -> None:
        station, context = self._station, self._context
        wanted = np.array(command["positions"])
        for name in _LIMP_JOINTS:
            row = JOINTS.index(name)
            stiffness = float(command["stiffnesses"][row])
            before = self._stiffness.get(name)
            if before != stiffness:
                station.set_joint_stiffness(name, stiffness)
                self._stiffness[name] = stiffness
            if before == 0.0 and stiffness > 0.0:
                self._restart_servo(name, wanted[row])
            if stiffness == 0.0:
                # A limp joint's command follows the joint. Applied, it would drag the joint's
                # friction along, a cycle late, and drive the joint away.
                wanted[row] = self._obeyed[row]
        self._obeyed = wanted
        if self._goal is not None:
            offset = np.array(command["goal_offset"])
            self._goal = step_follower(self._goal, offset, time_step=CYCLE, **_GOAL_MOTION)
            station.GetInputPort(f"{GOAL_OBJECT}.desired_state").FixValue(context, self._goal)
        station.GetInputPort("joint_position_command").FixValue(context, wanted[self._rows])
        station.GetInputPort("base_velocity_command").FixValue(context, command["base_velocity"])
        for k, name in enumerate(CAMERAS.values()):
            if station.HasInputPort(f"{name}.enabled"):
                port = station.GetInputPort(f"{name}.enabled")
                port.FixValue(context, [float(command["enabled"][k])])
        led_arm = str(command["led_arm"])
        if self._led_arm and not led_arm:
            self._led_hand.let_go()
            nothing = Value[list[ExternallyAppliedSpatialForce]]()
            station.GetInputPort("applied_forces").FixValue(context, nothing)
        self._led_arm, self._led_pose = led_arm, np.array(command["led_pose"])
        is_stiff = command["stiffnesses"][_HAND_ROWS] > 0.0
        hands = np.where(is_stiff, wanted[_HAND_ROWS], np.nan)
        station.GetInputPort("hand_command").FixValue(context, hands)

    def _restart_servo(self, name: str, position: float) -> None:
        """Restarts the servo of a joint that becomes stiff at its position [rad]."""
        servo = self._station.GetSubsystemByName("joint_servo")
        context = servo.GetMyMutableContextFromRoot(self._context)
        servo.restart(context, [BODY_JOINTS.index(name)], [position])

    def _publish(self, rate: float) -> None:
        station, now = self._station, self._config.epoch + self._context.get_time()
        velocities = np.zeros(len(JOINTS))
        velocities[self._rows] = self._eval("joint_velocity")
        touched, contacts = self._touched()
        X_WT = station.GetOutputPort("torso_pose").Eval(self._context)
        hands = {
            f"{arm}_hand": X_WT
            @ station.GetOutputPort(f"{arm}_hand_pose").Eval(self._context).translation()
            for arm in ("left", "right")
        }
        goal = station.plant.GetBodyByName(station.scene_models.goal_object)
        plant_context = station.plant.GetMyContextFromRoot(self._context)
        currents = np.zeros(len(JOINTS))
        torques = station.plant.get_net_actuation_output_port().Eval(plant_context)
        currents[self._rows] = np.abs(torques[self._motors]) * self._amperes
        base_pose = self._eval("base_pose")
        if now - self._scanned >= PERIOD:
            self._scanned = now
            query = station.GetOutputPort("ground_truth.query").Eval(self._context)
            self._state.write(ranges=self._range_sensors.measure(query, base_pose))
        self._state.write(
            time=now,
            currents=currents,
            positions=self._positions(),
            velocities=velocities,
            base_pose=base_pose,
            base_velocity=self._command.read()["base_velocity"],
            touched=touched,
            contacts=contacts,
            rate=rate,
            goal=station.plant.EvalBodyPoseInWorld(plant_context, goal).translation(),
            **hands,
        )
        for k, name in enumerate(CAMERAS.values()):
            self._publish_image(k, name)

    def _publish_image(self, camera: int, name: str) -> None:
        """Publishes a camera's image once it is rendered, at the latest when the next one is out.

        Then the robot's clock waits for it: otherwise images would be started faster than they are
        finished, and none would be the newest when done.
        """
        system = self._station.GetSubsystemByName(name)
        frame = system.last_frame(system.GetMyContextFromRoot(self._context))
        late = self._rendering[camera]
        if late is not None and late is not frame:
            self._write_image(camera, late)
        if not math.isfinite(frame.time) or frame.time <= self._stamps[camera]:
            return
        if frame.image.future.done():
            self._write_image(camera, frame)
        else:
            self._rendering[camera] = frame

    def _write_image(self, camera: int, frame: Frame) -> None:
        self._rendering[camera] = None
        pixels = frame.image.pixels()
        if pixels.size == 0:
            return
        self._stamps[camera] = frame.time
        data = np.ascontiguousarray(pixels[..., :3] if pixels.shape[2] == 4 else pixels)
        content = np.zeros(LARGEST_IMAGE, np.uint8)
        content[: data.nbytes] = data.view(np.uint8).ravel()
        self._images[camera].write(
            time=self._config.epoch + frame.time,
            width=pixels.shape[1],
            height=pixels.shape[0],
            pixels=content,
        )

    def _touched(self) -> tuple[npt.NDArray[np.bool_], int]:
        """Returns which of `SENSORS` are touched, and how many contacts Pepper has."""
        query: QueryObject = self._station.GetOutputPort("ground_truth.query").Eval(self._context)
        touched = np.array(self._command.read()["held_sensors"])
        contacts = 0
        x, y, yaw = self._eval("base_pose")
        for pair in query.ComputePointPairPenetration():
            mine = [self._links.get(pair.id_A), self._links.get(pair.id_B)]
            if mine.count(None) != 1:
                continue  # Neither geometry is Pepper's, or both are.
            contacts += 1
            link = mine[0] or mine[1]
            if link in _PALMS:
                touched[SENSORS.index(_PALMS[link])] = True
            elif link == "Tibia":
                ahead = pair.p_WCa[:2] - (x, y)
                side = math.remainder(math.atan2(ahead[1], ahead[0]) - yaw, 2 * math.pi)
                bumper = "Back" if abs(side) > 2.0 else "FrontLeft" if side > 0 else "FrontRight"
                touched[SENSORS.index(f"Platform/{bumper}/Bumper")] = True
        return touched, contacts


def _motor(joint: str) -> tuple[float, float]:
    ending = max((name for name in _MOTORS if joint.endswith(name)), key=len)
    return _MOTORS[ending]
