"""LeafSystems, one class per file: thin wrappers around the package's plain functions.

Those exported here do not depend on Pepper: they serve any robot whose hand follows a learned
movement, any camera and any point cloud. `examples/cartesian_robot.py` uses them with another
robot. Each has an example in its docstring.
"""

from pepper_drake.systems.primitive.canonical_system import CanonicalSystem, CanonicalSystem_
from pepper_drake.systems.primitive.coupling_sum import CouplingSum
from pepper_drake.systems.primitive.hand_goal_pose import HandGoalPose
from pepper_drake.systems.primitive.obstacle_coupling import ObstacleCoupling
from pepper_drake.systems.primitive.orientation_transformation_system import (
    OrientationTransformationSystem,
)
from pepper_drake.systems.primitive.phase_stopping_coupling import PhaseStoppingCoupling
from pepper_drake.systems.primitive.transformation_system import (
    TransformationSystem,
    TransformationSystem_,
)
from pepper_drake.systems.sensing.depth_point_cloud_source import DepthPointCloudSource
from pepper_drake.systems.sensing.goal_estimator import GoalEstimator

__all__ = [
    "CanonicalSystem",
    "CanonicalSystem_",
    "CouplingSum",
    "DepthPointCloudSource",
    "GoalEstimator",
    "HandGoalPose",
    "ObstacleCoupling",
    "OrientationTransformationSystem",
    "PhaseStoppingCoupling",
    "TransformationSystem",
    "TransformationSystem_",
]
