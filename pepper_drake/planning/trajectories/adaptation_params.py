"""Parameters of adapting a demonstrated movement to a scene."""

from dataclasses import dataclass, field
from typing import NamedTuple

from pepper_drake.planning.trajectories.rrt_connect import RrtConnectParams
from pepper_drake.planning.trajectories.trajectory_cost import PathCostParams
from pepper_drake.planning.trajectories.trajectory_search import PathSearchParams


class GoalAxis(NamedTuple):
    """The axis of the hand whose direction counts for the task."""

    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    """In H."""
    tolerance: float = 0.5
    """Angle from its goal within which goal postures are preferred [rad]."""


@dataclass
class AdaptationParams:
    """Parameters of adapting a demonstration."""

    cost: PathCostParams = field(default_factory=PathCostParams)
    search: PathSearchParams = field(default_factory=PathSearchParams)
    samples: int = 50
    """Number of samples of a path."""
    starts: int = 150
    """Postures of the library from which goal postures are solved for."""
    goals_kept: int = 3
    """Goal postures per demonstration."""
    turn: float = 0.6
    """Turn of the hand from the wanted goal orientation that costs 1 [rad]."""
    turn_margin: float = 0.05
    """Part of the goal axis's tolerance that goal postures leave [rad]."""
    posture: float = 1.0
    """Distance of the joints from the demonstration's end that costs 1 [rad]."""
    object_clearance: float = 0.004
    """Least distance to the goal object there, whose shape and place are known well [m]."""
    limit_margin: float = 0.02
    """Kept to joint limits [rad]."""
    candidates: int = 3
    """Largest number of demonstrations from which paths are searched."""
    good_cost: float = 4.0
    """A clear path that costs less is taken at once; others are compared."""
    planner: RrtConnectParams = field(default_factory=RrtConnectParams)
    """Looks for a way where none of them could be bent to one."""
    accepted_slack: float = -0.005
    """Lack of clearance with which a path is taken [m]."""
    corner_slack: float = 0.001
    """Clearance by which a sampled path may be below that of its start and goal [m]."""
    speed_share: float = 0.4
    """Share of the rated joint velocities that a path may use."""
    acceleration_share: float = 0.8
    """Share of the joints' acceleration limit that it may use."""
