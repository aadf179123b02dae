"""The distance field of point clouds at input ports, rebuilt only for a new cloud."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, InputPort

from pepper_drake.learning.dmp.point_cloud_distance import (
    EXTENSION,
    PointCloudDistance,
)
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.systems.framework import CacheEntry, LeafSystem, ValueProducer


class ObstacleFieldCache:
    """A cache entry with the PointCloudDistance of the PointClouds at a system's input ports.

    An unconnected cloud counts as empty. A recomputed but equal cloud costs a comparison, not
    another field.

    Args:
        system: The system that owns the cache; to be called in its constructor.
        cloud_ports: Its input ports of clouds in one frame, whose points are merged.
        extension: Downward extension of each point [m]; see `PointCloudDistance`.
    """

    def __init__(
        self, system: LeafSystem, *cloud_ports: InputPort, extension: float = EXTENSION
    ) -> None:
        self._cloud_ports, self._extension = cloud_ports, extension
        self.entry: CacheEntry = system.DeclareCacheEntry(
            "obstacle field",
            ValueProducer(allocate=lambda: Value({}), calc=self._calc),
            prerequisites_of_calc={port.ticket() for port in cloud_ports},
        )

    def eval(self, context: Context) -> PointCloudDistance:
        """Returns the field of the present clouds."""
        field: PointCloudDistance = self.entry.Eval(context)["field"]
        return field

    def _calc(self, context: Context, value: Any) -> None:
        clouds = [
            cloud_points(port.Eval(context)) for port in self._cloud_ports if port.HasValue(context)
        ]
        points = np.concatenate([np.zeros((0, 3), dtype=np.float32), *clouds])
        known = value.get_mutable_value()
        content = points.tobytes()
        if known.get("content") != content:
            known["content"] = content
            known["field"] = PointCloudDistance(points, extension=self._extension)
