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
from pepper_drake.learning.alignment import align
from pepper_drake.learning.approximators import approximator_names
from pepper_drake.learning.bimanual import BimanualPrimitive
from pepper_drake.learning.coupling import BarrierCoupling, ReportCoupling, make_coupling
from pepper_drake.learning.demonstration import TORSO_HEIGHT, Demonstration
from pepper_drake.learning.demonstration_folder import load_all
from pepper_drake.learning.ds_gmr import DsGmr, fit_ds_gmr
from pepper_drake.learning.gaussian_mixture import GaussianMixture, fit_gaussian_mixture
from pepper_drake.learning.modulated_ds import ModulatedSystem, fit_modulated_system
from pepper_drake.learning.obstacle_field import ObstacleField
from pepper_drake.learning.primitive import MovementPrimitive, Path3D
from pepper_drake.learning.promp import ProMP, fit_promp
from pepper_drake.learning.rhythmic import RhythmicPrimitive, fit_rhythmic
from pepper_drake.learning.rollout import PathBatch
from pepper_drake.learning.spread import Spread, spread_along
from pepper_drake.learning.tp_gmm import (
    TaskFrame,
    TaskParameterizedMixture,
    fit_task_parameterized,
    start_and_goal,
)

__all__ = [
    "TORSO_HEIGHT",
    "BarrierCoupling",
    "BimanualPrimitive",
    "Demonstration",
    "DsGmr",
    "GaussianMixture",
    "ModulatedSystem",
    "MovementPrimitive",
    "ObstacleField",
    "Path3D",
    "PathBatch",
    "ProMP",
    "ReportCoupling",
    "RhythmicPrimitive",
    "Spread",
    "TaskFrame",
    "TaskParameterizedMixture",
    "align",
    "approximator_names",
    "fit_ds_gmr",
    "fit_gaussian_mixture",
    "fit_modulated_system",
    "fit_promp",
    "fit_rhythmic",
    "fit_task_parameterized",
    "load_all",
    "make_coupling",
    "spread_along",
    "start_and_goal",
]
