"""Module, function and field names that keep working for one more release.

Importing a former module gives its successor, the same module object. Former names inside it are
added on that import. Former fields are read in scenario files and in `--set`.
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
_FIELDS_OF_A_CAMERA = {
    "approach": {
        "visit": "transient_timeout",
        "onward": "extrapolated",
        "likely": "usual_speed",
        "alike": "registered_within",
        "sluggishness": "regularization",
        "apart": "comparison_interval",
        "least_points": "min_points",
        "least_rest": "min_remaining_points",
        "fastest": "max_speed",
        "slowest": "rest_speed",
        "most_views": "max_views",
        "object_share": "object_fraction",
    },
    "memory": {
        "alike_distance": "similar_distance",
        "alike_angle": "similar_angle",
        "most_alike": "max_similar_views",
        "most_views": "max_views",
    },
    "validity": {
        "least_points": "min_points",
        "least_expected": "min_expected_points",
        "least_shown": "min_shown_fraction",
        "same_share": "scale_error_spread",
    },
    "near_field": {
        "likely": "usual_nearest",
        "least_rays": "min_rays",
        "kept": "retention_time",
    },
    "holes": {"least_views": "min_views"},
}
_FIELDS = {
    "perception.marker": {
        "whitest": "saturation_level",
        "systematic_share": "systematic_ratio",
        "window_share": "window_ratio",
    },
    "perception.marker.edges": {
        "search_share": "search_ratio",
        "found_share": "found_fraction",
        "least_edges": "min_edges",
        "least_error": "min_error",
        "least_offset": "min_exposure_offset",
        "least_contrast": "min_contrast",
        "least_step": "min_step",
        "least_support": "min_support",
    },
    "station.stereo_pair.matching": {"least_texture": "min_texture"},
    "station.stereo_pair.segmentation": {"lying": "horizontal_slope"},
    "planner": {
        "slack": "reach_margin",
        "room_lost": "placement_clearance_tolerance",
        "far_allowance": "predrive_clearance_tolerance",
        "rest_share": "rest_fraction",
        "places_with_slack": "max_placements_with_margin",
        "places_tried": "max_simulated_placements",
        "places_adapted": "max_adapted_placements",
        "places_planned": "max_path_planner_placements",
        "places_searched": "wide_search_placements",
        "shortest_detour": "min_detour_duration",
        "slowest": "acceptable_duration_ratio",
    },
    "planner.clearance": {"optimise": "search_target", "retreat": "retreat_end"},
    "planner.support_surface": {"least_stripes": "min_stripes"},
    "planner.unseen": {
        "oldest": "max_age",
        "least_cells": "min_cells",
        "least_drive_cells": "min_drive_cells",
        "drive": "check_drive",
        "accept": "allow_motion",
    },
    "planner.adaptation": {
        "starts": "ik_seeds",
        "speed_share": "speed_fraction",
        "acceleration_share": "acceleration_fraction",
    },
    "planner.adaptation.cost": {
        "leaving": "departure_fraction",
        "arriving": "arrival_fraction",
        "slack": "slack_weight",
    },
    "planner.adaptation.search": {"slack": "min_slack"},
    "planner.retreat": {"braking_share": "braking_fraction", "lost": "max_clearance_loss"},
    "planner.new_obstacle": {
        "near": "max_goal_distance",
        "fewest": "min_points",
        "side": "dilation",
        "moving_side": "moving_dilation",
        "stands_within": "stationary_tolerance",
        "left_within": "escape_time",
    },
    "supervisor": {
        "places": "max_base_placements",
        "reaching_timeout": "movement_timeout_ratio",
        "slow_reach": "max_slowdown_extension",
        "clearance_lost": "replan_clearance_loss",
    },
    "supervisor.separation": {"slowest": "min_speed_fraction"},
    "compliance.tracking": {
        "stopping": "slowdown_gain",
        "pull": "coupling_gain",
        "ignored": "dead_zone",
    },
} | {
    f"perception.{camera}.{group}": names
    for camera in ("obstacles", "stereo_obstacles")
    for group, names in _FIELDS_OF_A_CAMERA.items()
}
FIELDS = {
    "perception.head_velocity": "perception.gaze.max_velocity",
    "perception.head_acceleration": "perception.gaze.max_acceleration",
    "perception.goal.hand_on_improvement": "perception.goal.publish_improvement",
} | {
    f"{group}.{former}": f"{group}.{now}"
    for group, names in _FIELDS.items()
    for former, now in names.items()
}
"""Present names of a scenario's fields by their former names."""


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
