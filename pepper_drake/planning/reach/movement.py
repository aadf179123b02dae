"""The movement that the arm performs: planned before it starts, and replanned while it moves."""

from dataclasses import dataclass, field, replace

from pydrake.math import RigidTransform

from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.short_repr import short_repr, short_signature


@dataclass(frozen=True, eq=False)
class Movement:
    """A primitive and what is needed to perform it: the value of every port `movement`.

    A movement with an id above zero runs; a new id starts another one. With id 0 the arm rests, and
    the primitive is the next one to expect.

    Attributes:
        primitive: Primitive with orientation and posture, in T.
        coupling: Obstacle coupling; None for no obstacle avoidance.
        X_OG: The hand's pre-grasp pose in the goal object's frame.
        id: Number of the movement.
        origin: Origin of the movement.
        X_TG: The hand's goal, in place of X_OG, of a movement that does not lead to the goal object
            and so does not follow it; None for one that does.
    """

    __repr__ = short_repr
    __signature__ = short_signature

    primitive: MovementPrimitive
    coupling: Coupling | None = None
    X_OG: RigidTransform = field(default_factory=RigidTransform)
    id: int = 0
    origin: Origin = Origin.TAUGHT
    X_TG: RigidTransform | None = None

    def __deepcopy__(self, memo: dict) -> "Movement":
        """Returns itself: Drake copies stored values, and a movement is immutable."""
        return self

    def numbered(self, id: int) -> "Movement":
        """Returns the same movement with another id."""
        return replace(self, id=id)

    def hand_goal(self, X_TO: RigidTransform) -> RigidTransform:
        """Returns the hand's goal X_TG for a pose of the goal object."""
        return X_TO @ self.X_OG if self.X_TG is None else self.X_TG

    @property
    def runs(self) -> bool:
        """True if the arm performs it."""
        return self.id > 0

    def begins_after(self, last_id: float) -> bool:
        """True if it begins now, given the id of the last tick's movement."""
        return self.runs and self.id != last_id
