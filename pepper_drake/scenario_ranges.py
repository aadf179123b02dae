"""Ranges of a scenario's fields that no type says: divisors, counts, fractions."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import lru_cache
from operator import attrgetter
from typing import Any

from pepper_drake.errors import InputError
from pepper_drake.models.pepper import JOINT_GROUPS

_POSITIVE = (
    "compliance.stiffness",
    "contact.angle",
    "controller.angular_velocity_limit",
    "controller.catch_up_steps",
    "controller.linear_velocity_limit",
    "controller.speed_fraction",
    "controller.target_time_constant",
    "controller.time_step",
    "controller.tracking_rate",
    "perception.image_poll_period",
    "perception.marker.edges.blurred_growth",
    *(
        f"perception.{camera}.{name}"
        for camera in ("obstacles", "stereo_obstacles")
        for name in (
            "approach.spacing",
            "cloud.largest_spacing",
            "cloud.stride",
            "memory.voxel_size",
            "near_field.min_rays",
            "near_field.spacing",
        )
    ),
    *(
        f"perception.{camera}.{views}.max_views"
        for camera in ("obstacles", "stereo_obstacles")
        for views in ("memory", "approach")
    ),
    *(
        f"planner.{name}"
        for name in (
            "adaptation.acceleration_fraction",
            "adaptation.candidates",
            "adaptation.cost.arrival_fraction",
            "adaptation.cost.deviation",
            "adaptation.cost.departure_fraction",
            "adaptation.goals_kept",
            "adaptation.planner.resolution",
            "adaptation.planner.step",
            "adaptation.posture",
            "adaptation.search.generations",
            "adaptation.search.perturbation_basis",
            "adaptation.speed_fraction",
            "adaptation.ik_candidates",
            "adaptation.ik_seeds",
            "adaptation.turn",
            "new_obstacle.spacing",
            "support_surface.spacing",
            "support_surface.stripe",
            "unseen.cell",
            "unseen.stride",
        )
    ),
    *(
        f"safety.{base}.{name}"
        for base in ("base", "link_base")
        for name in ("acceleration", "turning_acceleration", "approach_rate")
    ),
    "safety.lean.acceleration",
    "safety.lean.speed",
    "safety.lean.tolerance",
    "safety.time_step",
    "station.camera_period",
    "station.command_period",
    "station.time_step",
    "supervisor.separation.deceleration",
    "supervisor.separation.slowing",
    "supervisor.steadiness.cloud_memory",
    "supervisor.steadiness.memory",
    "supervisor.time_step",
)
"""Fields that must be positive: divisors and counts."""
_FRACTIONS = (
    "planner.lean.image_border",
    "planner.rest_fraction",
    "planner.unseen.image_border",
    "supervisor.steadiness.cloud_quantile",
)
"""Fields that must be at least 0 and below 1."""
_LEAST = {
    "seed": 0,
    "contact.latency": 0,
    "contact.steps": 1,
    "perception.obstacles.holes.side_rows": 1,
    "perception.stereo_obstacles.holes.side_rows": 1,
    "planner.adaptation.samples": 10,
    "planner.adaptation.search.population": 4,
    "controller.orientation_weight": 0,
    "controller.position_weight": 0,
    "planner.new_obstacle.carrier_depth": 0,
    "planner.new_obstacle.carrier_near": 0,
    "planner.retreat.max_clearance_loss": 0,
    "planner.settle": 0,
    "planner.solid_depth": 0,
    "station.camera_latency": 0,
    "station.derivative_gain": 0,
    "station.proportional_gain": 0,
    "planner.support_surface.min_stripes": 1,
    "planner.support_surface.rim": 0,
    "supervisor.latency.base_placement": 0,
    "supervisor.latency.check": 0,
    "supervisor.latency.drive": 0,
    "supervisor.latency.plan": 0,
}
"""Least values of some fields."""


_SIGNED = (
    "barrier.margin",
    "perception.gaze.search.first_yaw",
    "perception.gaze.search.low_pitch",
    "perception.gaze.search.sweep",
    "perception.gaze.view.hand_left",
    "perception.obstacles.cloud.floor_height",
    "perception.obstacles.near_field.floor",
    "perception.stereo_obstacles.cloud.floor_height",
    "perception.stereo_obstacles.near_field.floor",
    "planner.barrier_margin",
    "planner.hand_x",
    "planner.hand_y",
    "planner.unseen.floor",
)
"""Fields that may be negative though their default is not: places, angles, margins."""


def _numbers(part: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Yields names and values of the numbers in a dataclass and those that it holds."""
    for one in fields(part):
        value, name = getattr(part, one.name), f"{prefix}{one.name}"
        if is_dataclass(value):
            yield from _numbers(value, f"{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield name, value


@lru_cache(maxsize=1)
def _sizes(kind: Any) -> frozenset[str]:
    """Returns the names of the numbers of a `Scenario` (its class) that are positive by default."""
    named = [name for name, value in _numbers(kind()) if value > 0]
    return frozenset(name for name in named if not name.startswith("scene.")) - {*_SIGNED}


def check_ranges(scenario: Any) -> None:
    """Checks a `Scenario`.

    Raises:
        InputError: A field is out of its range, or a pair of fields in the wrong order.
    """
    for name in _POSITIVE:
        value = attrgetter(name)(scenario)
        if not value > 0:
            raise InputError(f"{name} is {value:g}; it must be positive")
    for name, least in _LEAST.items():
        value = attrgetter(name)(scenario)
        if value < least:
            raise InputError(f"{name} is {value:g}; it must be {least} or more")
    planner = scenario.planner
    if planner.upper_body_clearance < planner.hanging_clearance:
        raise InputError(
            f"planner.upper_body_clearance is {planner.upper_body_clearance:g} m; it must not be "
            f"less than planner.hanging_clearance, {planner.hanging_clearance:g} m"
        )
    ik = scenario.controller
    if not ik.limit_margin < ik.limit_influence:
        raise InputError(
            f"controller.limit_influence is {ik.limit_influence:g} rad; it must be greater than "
            f"controller.limit_margin, {ik.limit_margin:g} rad"
        )
    station = scenario.station
    if not station.camera_latency < station.camera_period:
        raise InputError(
            f"station.camera_latency is {station.camera_latency:g} s; it must be less than "
            f"station.camera_period, {station.camera_period:g} s"
        )
    for name in _FRACTIONS:
        value = attrgetter(name)(scenario)
        if not 0.0 <= value < 1.0:
            raise InputError(f"{name} is {value:g}; it must be at least 0 and below 1")
    for group, value in scenario.station.stiffness.items():
        if group not in JOINT_GROUPS:
            raise InputError(
                f'station.stiffness names "{group}"; the joint groups are {", ".join(JOINT_GROUPS)}'
            )
        if not 0.0 <= value <= 1.0:
            raise InputError(f"station.stiffness of {group} is {value:g}; it must be from 0 to 1")
    stiffness = scenario.compliance.stiffness
    if stiffness > 1.0:
        raise InputError(f"compliance.stiffness is {stiffness:g}; it must be above 0 and at most 1")
    kind: Any = type(scenario)
    sizes = _sizes(kind)
    for name, value in _numbers(scenario):
        if value < 0 and name in sizes:
            raise InputError(f"{name} is {value:g}; it must not be negative")
