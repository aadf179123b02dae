"""What the arm is to perform: decided before it starts, and again while it moves."""

from dataclasses import dataclass

from pydrake.math import RigidTransform

from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.coupling import Coupling


@dataclass(frozen=True, eq=False)
class Movement:
    """A primitive with what it takes to perform it.

    Attributes:
        primitive: With orientation and posture, in T.
        coupling: How obstacles bend it; None to do without.
        X_OG: The hand's pre-grasp pose in the goal object's frame.
    """

    primitive: MovementPrimitive
    coupling: Coupling | None
    X_OG: RigidTransform
