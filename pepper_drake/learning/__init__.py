"""Demonstrations to movement primitives, as plain functions and dataclasses."""

from pepper_drake.learning import (
    forcing_regression as forcing_regression,
)
from pepper_drake.learning import (
    gmr as gmr,
)
from pepper_drake.learning import (
    lwpr as lwpr,
)
from pepper_drake.learning import (
    trajectory_regression as trajectory_regression,
)
from pepper_drake.learning.approximators import approximator_names
from pepper_drake.learning.coupling import BarrierCoupling, ReportCoupling, make_coupling
from pepper_drake.learning.demonstration import TORSO_HEIGHT, Demonstration
from pepper_drake.learning.obstacle_field import ObstacleField
from pepper_drake.learning.primitive import MovementPrimitive, Path3D

__all__ = [
    "TORSO_HEIGHT",
    "BarrierCoupling",
    "Demonstration",
    "MovementPrimitive",
    "ObstacleField",
    "Path3D",
    "ReportCoupling",
    "approximator_names",
    "make_coupling",
]
