"""Demonstrations to movement primitives, as plain functions and dataclasses."""

from pepper_drake.learning.approximators import forcing_regression as forcing_regression
from pepper_drake.learning.approximators import gmr as gmr
from pepper_drake.learning.approximators import lwpr as lwpr
from pepper_drake.learning.approximators import trajectory_regression as trajectory_regression
from pepper_drake.learning.approximators.registry import (
    Approximator,
    ForcingData,
    ForcingModel,
    LinearForcingModel,
    approximator_names,
    get_approximator,
    register,
)
from pepper_drake.learning.demonstrations.alignment import align
from pepper_drake.learning.demonstrations.check import DemonstrationReport, examine
from pepper_drake.learning.demonstrations.demonstration import TORSO_HEIGHT, Demonstration
from pepper_drake.learning.demonstrations.demonstration_folder import load_all
from pepper_drake.learning.dmp.bimanual import BimanualPrimitive
from pepper_drake.learning.dmp.chain import Chain, Step, plan_chain
from pepper_drake.learning.dmp.joint_primitive import JointPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import (
    BarrierCoupling,
    Coupling,
    CouplingOutput,
    ReportCoupling,
    get_coupling,
    register_coupling,
)
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.learning.dmp.primitive import MovementPrimitive, Path3D
from pepper_drake.learning.dmp.rhythmic import RhythmicPrimitive, fit_rhythmic
from pepper_drake.learning.dmp.rollout import PathBatch
from pepper_drake.learning.probabilistic.ds_gmr import DsGmr, fit_ds_gmr
from pepper_drake.learning.probabilistic.gaussian_mixture import (
    GaussianMixture,
    fit_gaussian_mixture,
)
from pepper_drake.learning.probabilistic.modulated_ds import ModulatedSystem, fit_modulated_system
from pepper_drake.learning.probabilistic.promp import ProMP, fit_promp
from pepper_drake.learning.probabilistic.tp_gmm import (
    TaskFrame,
    TaskParameterizedMixture,
    fit_task_parameterized,
    start_and_goal,
)
from pepper_drake.learning.probabilistic.variability import Spread, variability_along

__all__ = [
    "TORSO_HEIGHT",
    "Approximator",
    "BarrierCoupling",
    "BimanualPrimitive",
    "Chain",
    "Coupling",
    "CouplingOutput",
    "Demonstration",
    "DemonstrationReport",
    "DsGmr",
    "ForcingData",
    "ForcingModel",
    "GaussianMixture",
    "JointPrimitive",
    "LinearForcingModel",
    "ModulatedSystem",
    "MovementPrimitive",
    "Path3D",
    "PathBatch",
    "PointCloudDistance",
    "ProMP",
    "ReportCoupling",
    "RhythmicPrimitive",
    "Spread",
    "Step",
    "TaskFrame",
    "TaskParameterizedMixture",
    "align",
    "approximator_names",
    "examine",
    "fit_ds_gmr",
    "fit_gaussian_mixture",
    "fit_modulated_system",
    "fit_promp",
    "fit_rhythmic",
    "fit_task_parameterized",
    "get_approximator",
    "get_coupling",
    "load_all",
    "plan_chain",
    "register",
    "register_coupling",
    "start_and_goal",
    "variability_along",
]
