"""The movement that the arm performs: decided before it starts, and again while it moves."""

from dataclasses import dataclass, field, replace

from pydrake.math import RigidTransform

from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class Movement:
    """A primitive with all that it takes to perform it: the value of every port `movement`.

    A movement with a number above zero runs; with another number another one takes its place. The
    movement number 0 does not run: the arm rests, and its primitive is the next one to expect.

    Attributes:
        primitive: With orientation and posture, in T.
        coupling: The law by which obstacles bend it; None to do without.
        X_OG: The hand's pre-grasp pose in the goal object's frame.
        id: Number of the movement.
        origin: Where it comes from.
    """

    __repr__ = short_repr

    primitive: MovementPrimitive
    coupling: Coupling | None = None
    X_OG: RigidTransform = field(default_factory=RigidTransform)
    id: int = 0
    origin: Origin = Origin.TAUGHT

    def __deepcopy__(self, memo: dict) -> "Movement":
        """Returns itself: Drake copies values that it keeps, and a movement never changes."""
        return self

    def numbered(self, id: int) -> "Movement":
        """Returns the same movement under a number."""
        return replace(self, id=id)

    @property
    def runs(self) -> bool:
        """True if the arm performs it."""
        return self.id > 0

    def begins_after(self, last_id: float) -> bool:
        """True if it begins now, given the number of the last tick's movement."""
        return self.runs and self.id != last_id
