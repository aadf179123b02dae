"""Configuration of the simulated robot, set by a scenario's `station`."""

from dataclasses import dataclass, field

from pepper_drake.diagrams.stereo_camera import StereoConfig
from pepper_drake.models.control_model import CONTROL_PERIOD
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.robot_calibration import RobotCalibration
from pepper_drake.models.robot_wear import RobotWear
from pepper_drake.systems.faults.fault_set import FaultSet


@dataclass
class StationConfig:
    """Configuration of the simulated robot."""

    time_step: float = 0.005
    """Step of the physics [s]."""
    command_period: float = CONTROL_PERIOD
    """Period at which joint commands arrive [s]."""
    cameras: bool = True
    """True for a robot with cameras; without them runs are several times faster."""
    camera_period: float = 0.2
    """Time between images of each camera [s]."""
    camera_latency: float = 0.15
    """Time from an image's capture to its arrival [s]; an assumption for images over a network."""
    noise: bool = True
    """True to simulate the noise of the real cameras."""
    stereo: bool = False
    """True to replace the depth camera by a stereo pair with a projector; 20 times as slow."""
    stereo_pair: StereoConfig = field(default_factory=StereoConfig)
    """Matching and segmentation of its images."""
    seed: int = 0
    """Seed of all sensor noise."""
    goal_motion_port: bool = False
    """True if the goal object's motion is an input, `goal_object.desired_state`; otherwise it
    follows its path in the scene by simulation time."""
    obstacle_motion_ports: bool = False
    """True if the motion of each obstacle that has a path is an input, too."""
    stiffness: dict[str, float] = field(default_factory=lambda: dict.fromkeys(JOINT_GROUPS, 1.0))
    """Stiffness of each joint group, from 0 (limp) to 1, as in NAOqi."""
    proportional_gain: float = 400.0
    """Gain at stiffness 1 [N m/rad], for the base's x and y [N/m]; body and base have more."""
    derivative_gain: float = 10.0
    """Gain at stiffness 1 [N m s/rad]; body and base have more. It is proportional to the square
    root of the stiffness, which keeps the damping ratio constant."""

    wear: RobotWear | None = None
    """Errors of a worn robot; None for one as in its model. A stereo pair has none of its own."""
    calibration: RobotCalibration | None = None
    """Estimated errors, used to correct measurements and commands; None for none."""
    faults: FaultSet = field(default_factory=FaultSet)
    """Signals that fail during the run."""
