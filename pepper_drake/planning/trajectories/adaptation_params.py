"""Parameters of the adaptation of a demonstrated movement to a scene."""

from dataclasses import dataclass, field
from typing import NamedTuple

from pepper_drake.planning.trajectories.rrt_connect import RrtConnectParams
from pepper_drake.planning.trajectories.trajectory_cost import PathCostParams
from pepper_drake.planning.trajectories.trajectory_search import PathSearchParams


class GoalAxis(NamedTuple):
    """The axis of the hand whose direction matters for the task."""

    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    """Direction in H."""
    tolerance: float = 0.5
    """Angle from its goal direction within which goal configurations are preferred [rad]."""


@dataclass
class AdaptationParams:
    """Parameters of the adaptation."""

    cost: PathCostParams = field(default_factory=PathCostParams)
    search: PathSearchParams = field(default_factory=PathSearchParams)
    samples: int = 50
    """Number of samples of a path."""
    ik_seeds: int = 150
    """Number of library postures at which the inverse kinematics of the goal starts."""
    ik_candidates: int = 1000
    """Number of library postures, those nearest to the goal, among which the ones with a well
    turned hand are chosen first."""
    goals_kept: int = 3
    """Goal configurations per demonstration."""
    turn: float = 0.6
    """Rotation of the hand from the desired goal orientation that costs 1 [rad]."""
    turn_margin: float = 0.05
    """Margin that goal configurations keep to the goal axis's tolerance [rad]."""
    posture: float = 1.0
    """Distance of the joints from the demonstration's end that costs 1 [rad]."""
    object_clearance: float = 0.004
    """Least clearance of goal configurations to the goal object, which is known well [m]."""
    limit_margin: float = 0.02
    """Margin that goal configurations keep to joint limits [rad]."""
    candidates: int = 3
    """Largest number of demonstrations from which paths are searched."""
    good_cost: float = 4.0
    """A clear path of lower cost is taken at once; others are compared."""
    planner: RrtConnectParams = field(default_factory=RrtConnectParams)
    """Path planner for cases in which no demonstration can be adapted."""
    accepted_slack: float = -0.005
    """Least clearance slack of an accepted path [m]."""
    corner_slack: float = 0.001
    """Clearance by which a sampled path may be below that of its start and goal [m]."""
    speed_fraction: float = 0.4
    """Fraction of the rated joint velocities that a path may use."""
    acceleration_fraction: float = 0.8
    """Fraction of the joints' acceleration limits that a path may use."""
