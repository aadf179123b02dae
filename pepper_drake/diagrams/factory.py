"""Makes scene, primitive and coupling from a user's choices."""

from dataclasses import dataclass, replace
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.approximators.registry import get_approximator
from pepper_drake.learning.demonstrations.arm_chain import arm_of
from pepper_drake.learning.demonstrations.check import refuse_out_of_reach
from pepper_drake.learning.dmp.obstacle_coupling import BarrierCoupling, Coupling, get_coupling
from pepper_drake.learning.dmp.orientation import ORIENTATIONS
from pepper_drake.learning.dmp.primitive import DEFAULT_APPROXIMATOR, DEFAULT_SCALING
from pepper_drake.learning.dmp.scaling import check_scaling
from pepper_drake.models.motion import MOTION_DIRECTIONS, goal_motion, load_path
from pepper_drake.models.pepper import MODELS_DIR
from pepper_drake.models.scene import Scene
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.reach_parameters import ReachTiming

SHIPPED_DEMONSTRATION = MODELS_DIR / "demonstrations" / "reach"
"""A right arm's reach, guided by hand without obstacles."""

SHORTEST_PATH = 0.01
"""Shortest path of the hand that counts as a demonstration [m]."""


def hand_barrier() -> BarrierCoupling:
    """Returns the barrier around Pepper's hand.

    Its sphere encloses the half-open hand except for the fingertips, and is larger than the hand is
    thin. Near the goal, where the hand's orientation is known, obstacles may therefore be closer
    than the sphere allows; the planner checks the true shapes.
    """
    return BarrierCoupling(hand_radius=0.09, goal_margin=0.015, goal_distance=0.08)


def make_coupling(name: str, barrier: BarrierCoupling | None = None) -> Coupling | None:
    """Returns the hand's obstacle coupling by name, or None for "none".

    Args:
        name: "barrier", "report" (equation 2.7), or a registered name.
        barrier: Used for the name "barrier"; `hand_barrier()` if None.

    Raises:
        InputError: The name is unknown.
    """
    if name == "none":
        return None
    if name == "barrier":
        return barrier or hand_barrier()
    return get_coupling(name)


@dataclass
class LearningParams:
    """Parameters of fitting a primitive; see `MovementPrimitive.fit`."""

    approximator: str = DEFAULT_APPROXIMATOR
    """Approximator of the forcing term: "lwr" is the report's."""
    num_basis: int = 0
    """Number of basis functions; 0 to let the demonstration decide. The report has 40."""
    scaling: str = DEFAULT_SCALING
    """Scaling of the forcing term with start and goal: "goal" is the report's factor g - y0."""
    orientation: str = "log_map"
    """Coordinates of the orientation: "angles" are the report's."""

    def check(self) -> None:
        """Raises InputError unless the names are known and the number is not negative."""
        get_approximator(self.approximator)
        check_scaling(self.scaling)
        if self.orientation not in ORIENTATIONS:
            raise InputError(
                f'learning.orientation is "{self.orientation}"; it must be one of '
                f"{', '.join(ORIENTATIONS)}"
            )
        if self.num_basis < 0:
            raise InputError(f"learning.num_basis is {self.num_basis}; it must be 0 or more")

    def fit(self, demonstration: Demonstration) -> MovementPrimitive:
        """Learns a primitive."""
        return MovementPrimitive.fit(
            demonstration,
            approximator=self.approximator,
            num_basis=self.num_basis or None,
            scaling=self.scaling,
            orientation=self.orientation,
        )


def make_primitive(
    demonstration: Path | None, arm: str, learning: LearningParams | None = None
) -> MovementPrimitive:
    """Learns the primitive that an arm performs.

    Args:
        demonstration: A demonstration's folder; the shipped one if omitted. If orientation or
            joints are missing, they are taken from the shipped one.
        arm: "left" or "right"; a demonstration with the other arm is mirrored.
        learning: Parameters of the fit; the defaults if omitted.

    Raises:
        InputError: The demonstration cannot be read.
    """
    learning = learning or LearningParams()
    demo = _for_arm(Demonstration.load(SHIPPED_DEMONSTRATION), arm)
    shipped = learning.fit(demo)
    if demonstration is None:
        return shipped
    shown = _for_arm(Demonstration.load(demonstration), arm)
    if shown.path_length < SHORTEST_PATH:
        raise InputError(
            f"{demonstration}: the hand moves by {1000 * shown.path_length:.1f} mm only; "
            "record a movement"
        )
    refuse_out_of_reach(shown, str(demonstration))
    own = learning.fit(shown)
    # A posture is only usable if it has all joints of the arm.
    whole = own.posture is not None and arm_of(own.posture.names) == arm
    return replace(
        own,
        orientation=own.orientation if own.orientation is not None else shipped.orientation,
        posture=own.posture if whole else shipped.posture,
    )


def make_gentle(
    primitive: MovementPrimitive, ik: DifferentialIkParams, timing: ReachTiming
) -> tuple[MovementPrimitive, DifferentialIkParams]:
    """Slows a movement and the arm's joints down so that no point exceeds 250 mm/s.

    The fastest point of the shipped demonstration moves at 0.8 m/s; replanned movements and
    retreats are limited by the joints' speed.
    """
    return (
        replace(primitive, duration=timing.gentle_duration * primitive.duration),
        replace(ik, speed_fraction=min(ik.speed_fraction, timing.gentle_speed)),
    )


def _for_arm(demonstration: Demonstration, arm: str) -> Demonstration:
    """Returns the demonstration, mirrored if the recorded arm (right if unknown) is the other."""
    recorded = "left" if any(n.startswith("L") for n in demonstration.joint_names) else "right"
    return demonstration if arm == recorded else demonstration.mirrored()


def prepare_scene(scene: Scene, *, arm: str | None = None, motion: str | None = None) -> Scene:
    """Changes a scene according to command-line options.

    Args:
        scene: The loaded scene.
        arm: The arm that reaches; if it is not the scene's, the scene is mirrored.
        motion: "up", "aside" or "away" (8 cm), or a path file: motion of the goal object from when
            the arm starts.

    Raises:
        InputError: The motion is unknown or its file cannot be read.
    """
    if arm is not None and arm != scene.arm:
        scene = scene.mirrored()
    if motion is not None:
        path = (
            goal_motion(motion, scene.arm, start=0.3)
            if motion in MOTION_DIRECTIONS or not Path(motion).exists()
            else load_path(Path(motion))
        )
        scene = replace(scene, goal=replace(scene.goal, path=path))
        scene.check()
    return scene
