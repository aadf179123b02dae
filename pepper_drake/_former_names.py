"""Module and function names of release 0.1 that keep working for one more release.

Importing a former module gives its successor, the same module object. Former names inside it are
added on that import.
"""

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

_MODULES = {
    "pepper_drake.perception.approach": "pepper_drake.perception.mapping.dynamic_obstacles",
    "pepper_drake.perception.cloud": "pepper_drake.perception.mapping.cloud",
    "pepper_drake.perception.marker": "pepper_drake.perception.goal.marker",
    "pepper_drake.perception.obstacles": "pepper_drake.perception.mapping.obstacle_map",
    "pepper_drake.perception.voxel_map": "pepper_drake.perception.mapping.voxel_map",
    "pepper_drake.perception.watch": "pepper_drake.perception.mapping.dynamic_obstacle_tracker",
    "pepper_drake.systems.camera_model": "pepper_drake.systems.sensing.camera_model",
    "pepper_drake.systems.depth_point_cloud_source": (
        "pepper_drake.systems.sensing.depth_point_cloud_source"
    ),
    "pepper_drake.systems.goal_estimator": "pepper_drake.systems.sensing.goal_estimator",
}

_NAMES = {
    "pepper_drake.perception.mapping.dynamic_obstacles": {"DepthView": "DepthFrame"},
    "pepper_drake.perception.mapping.dynamic_obstacle_tracker": {
        "Watch": "DynamicObstacleTracker",
        "keep_watch": "update_tracker",
        "veiled": "occluded_points",
    },
    "pepper_drake.perception.mapping.obstacle_map": {"NoObstacle": "ExcludedSolids"},
}


class _FormerModules(MetaPathFinder, Loader):
    """Imports a former module name as its successor."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname in _MODULES else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        successor = _MODULES[spec.name]
        warnings.warn(f"{spec.name} is now {successor}", DeprecationWarning, stacklevel=2)
        module = importlib.import_module(successor)
        spec.loader_state = module.__spec__
        for former, now in _NAMES.get(successor, {}).items():
            setattr(module, former, getattr(module, now))
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restores the successor's own spec, which import has replaced by the former one."""
        assert module.__spec__ is not None
        module.__spec__ = module.__spec__.loader_state


def install() -> None:
    """Makes former module names importable; repeated calls have no effect."""
    if not any(isinstance(finder, _FormerModules) for finder in sys.meta_path):
        sys.meta_path.append(_FormerModules())
