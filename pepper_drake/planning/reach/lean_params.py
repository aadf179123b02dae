"""Parameters of leaning forward to low goals."""

from dataclasses import dataclass, field

from pepper_drake.errors import InputError

MIN_HIP_PITCH, MAX_HIP_PITCH = -0.55, 0.1
"""Hip angles beyond which the robot is close to falling over [rad]."""


@dataclass
class LeanParams:
    """Hip angles at which the arm reaches a low goal that the head sees as well."""

    hip_pitch: list[float] = field(default_factory=lambda: [-0.03, -0.2, -0.3])
    """Hip angles that are tried [rad], in this order; none for a robot that does not lean. Beyond
    -0.35 the leg is in the way of an arm that hangs down."""
    height: float = -0.05
    """Height of the hand's goal above the torso's origin below which it counts as low [m]: from
    many base placements the tablet hides it."""
    image_border: float = 0.25
    """Border, as a fraction of half the image, in which the marker's centre must not be: the whole
    marker must be in the image."""

    def check(self) -> None:
        """Raises InputError for a hip angle at which the robot could fall over."""
        if not all(MIN_HIP_PITCH <= angle <= MAX_HIP_PITCH for angle in self.hip_pitch):
            raise InputError(
                f"planner.lean.hip_pitch is {self.hip_pitch}; each angle must be between "
                f"{MIN_HIP_PITCH:g} and {MAX_HIP_PITCH:g} rad, beyond which the robot is close "
                "to falling over"
            )
