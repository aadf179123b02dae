"""Cost of a joint trajectory: proximity, duration, distance to the demonstration."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.collision.arm_collision_checker import ArmCollisionChecker
from pepper_drake.planning.trajectories.compiled_cost import CostNumbers, rate_paths
from pepper_drake.planning.trajectories.joint_trajectories import minimum_jerk

Vector = npt.NDArray[np.float64]


@dataclass
class PathCostParams:
    """Weights and scales of the cost's terms."""

    end_allowance: float = 0.001
    """Clearance by which a path near its start and goal may be below that at the ends [m]."""
    departure_fraction: float = 0.2
    """Fraction of the time in which the desired clearance rises from that of the start."""
    arrival_fraction: float = 0.3
    """Fraction of the time in which it falls to that of the goal."""
    proximity_weight: float = 20.0
    """Weight of the sum over spheres of the squared missing clearance, relative to `clearance`."""
    slack_weight: float = 300.0
    """Weight of the largest missing clearance [1/m]."""
    deviation: float = 0.1
    """Root mean square deviation of the hand from the reference that costs 1 [m]."""
    effort: float = 0.002
    """Weight of the mean squared joint acceleration [s⁴/rad²]."""
    duration_weight: float = 8.0
    """Weight of the relative excess of the minimum duration over the duration."""


class TrajectoryRating(NamedTuple):
    """Costs of K paths.

    Attributes:
        cost: (K,).
        slack: (K,) least clearance minus desired clearance [m].
    """

    cost: Vector
    slack: Vector


class TrajectoryCost:
    """Rates paths against references with the same start and goal postures.

    With d_i the distance of sphere i, c_i the clearance wanted of it at that time, e the hand's
    deviation from the reference and T' the duration that the joints' limits ask for,

        J = proximity_weight mean_t sum_i [max(0, c_i - d_i) / clearance]²
            + slack_weight max(0, -min(d_i - c_i)) + (rms e / deviation)² + effort mean |q''|²
            + duration_weight max(0, T' / T - 1).

    Args:
        checker: Distances of the arm to obstacles.
        references: (R, N, 5) paths to be like, with their start and goal [rad]: one for all paths,
            or one for each.
        duration: Of the paths, T [s].
        velocity: (5,) what the joints may do [rad/s].
        acceleration: (5,) what the joints may do [rad/s²].
        params: The weights.
        clearance: Wanted between the arm's spheres and everything around it [m].
    """

    def __init__(
        self,
        checker: ArmCollisionChecker,
        references: Vector,
        *,
        duration: float,
        velocity: Vector,
        acceleration: Vector,
        params: PathCostParams,
        clearance: float,
    ) -> None:
        self._checker = checker
        count, samples, joints = references.shape
        hand = checker.kinematics.poses(references.reshape(-1, joints)).hand_position
        ends = checker.approximate_distances(references[:, [0, -1]].reshape(-1, joints))
        ends = np.moveaxis(ends.reshape(count, 2, -1), 1, 2)
        wanted = wanted_clearance(ends, samples, params, clearance)  # (R, S, samples)
        weights = [
            params.proximity_weight,
            params.slack_weight,
            1.0 / params.deviation**2,
            params.effort,
            params.duration_weight,
        ]
        self._numbers = CostNumbers(
            np.ascontiguousarray(hand.reshape(count, samples, 3).swapaxes(1, 2)),
            wanted,
            np.array(velocity),
            np.array(acceleration),
            float(duration),
            1.0 / clearance,
            np.array(weights),
        )

    def __call__(self, paths: Vector) -> TrajectoryRating:
        """Rates paths (K, N, 5).

        Raises:
            ValueError: There are several references, but not one for each path.
        """
        checker, count = self._checker, len(paths)
        if len(self._numbers.hand) not in (1, count):
            raise ValueError(f"{count} paths cannot be rated against {len(self._numbers.hand)}")
        cost, slack = rate_paths(
            np.ascontiguousarray(paths.swapaxes(1, 2)),
            checker.kinematics.chain,
            checker.moving,
            checker.grid.arrays,
            self._numbers,
        )
        return TrajectoryRating(cost, slack.astype(float))


def wanted_clearance(
    end_gaps: npt.NDArray[np.floating], samples: int, params: PathCostParams, clearance: float
) -> npt.NDArray[np.float32]:
    """The clearance (..., samples) wanted of each sphere along paths.

    Where a path starts and where it ends is given; a sphere that is nearer than wanted there need
    not be farther close to there, either.

    Args:
        end_gaps: (..., 2) distances at the start and at the goal [m].
        samples: Number of even times along a path.
        params: Shares of the time.
        clearance: Wanted between both [m].
    """
    s = np.linspace(0.0, 1.0, samples)
    away = 1.0 - minimum_jerk(s / params.departure_fraction)
    close = minimum_jerk((s - 1.0 + params.arrival_fraction) / params.arrival_fraction)
    lack = np.maximum(clearance - (end_gaps - params.end_allowance), 0.0)
    return (clearance - lack[..., :1] * away - lack[..., 1:] * close).astype(np.float32)
