"""Configuration of the simulated robot: what a scenario's `station` sets."""

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
    """True for a robot with cameras; without them a run is several times faster."""
    camera_period: float = 0.2
    """Time between images of each camera [s]."""
    camera_latency: float = 0.15
    """From an image's capture until it is out [s]; assumed for images that come over a network."""
    noise: bool = True
    """True to give the cameras the noise of the real ones."""
    stereo: bool = False
    """True for a stereo pair with a projector in the depth camera's place; 20 times as slow."""
    stereo_pair: StereoConfig = field(default_factory=StereoConfig)
    """Matching and segmentation of its images."""
    seed: int = 0
    """Seed of all sensor noise."""
    goal_motion_port: bool = False
    """True if the goal object's motion comes in by the port `goal_object.desired_state`, and not
    from the path in its scene by the clock."""
    obstacle_motion_ports: bool = False
    """True if the motion of each obstacle that has a path comes in by a port in the same way."""
    stiffness: dict[str, float] = field(default_factory=lambda: dict.fromkeys(JOINT_GROUPS, 1.0))
    """Stiffness of each joint group, from 0 (limp) to 1, as NAOqi has it."""
    proportional_gain: float = 400.0
    """Gain at stiffness 1 [N m/rad], for the base's x and y [N/m]; body and base have more."""
    derivative_gain: float = 10.0
    """Gain at stiffness 1 [N m s/rad]; body and base have more. It goes with the root of the
    stiffness, so that a soft joint is damped as well as a stiff one."""

    wear: RobotWear | None = None
    """Errors of a used robot; None for one as in its model. A stereo pair has none of its own."""
    calibration: RobotCalibration | None = None
    """Errors that are known, by which measurements and commands are corrected; None for none."""
    faults: FaultSet = field(default_factory=FaultSet)
    """Signals that fail during the run."""
