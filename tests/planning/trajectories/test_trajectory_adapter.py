import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.models.control_model import shared_control_model
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.clearance_table import ClearanceTable
from pepper_drake.planning.trajectories import trajectory_adapter
from pepper_drake.planning.trajectories.adaptation_params import AdaptationParams
from pepper_drake.planning.trajectories.trajectory_adapter import TrajectoryAdapter

MODEL = shared_control_model()
START, GOAL = np.array([1.3, -0.2, 1.2, 0.6, 0.0]), np.array([0.6, -0.5, 1.0, 1.1, 0.5])


class Passage:
    """Stands in for a collision checker: wide at the start and at the goals, narrow elsewhere."""

    def __init__(self, width):
        self.width, self.has_been_asked = width, False

    def object_distances(self, joints):
        return np.full(len(joints), 0.1)

    def distances(self, joints):
        return np.full(len(joints), 0.1)

    def approximate_distances(self, joints):
        # Start and goals are asked for first.
        width = self.width if self.has_been_asked else 0.1
        self.has_been_asked = True
        return np.full((len(joints), 3), width)

    def keep_distances(self, joints, least):
        return (self.approximate_distances(joints) >= least).all(axis=1)


@pytest.mark.parametrize(
    ("over", "is_tried"),
    [(0.001, True), (-0.002, False)],
    ids=["as wide as the arm may pass slowly", "narrower"],
)
def test_the_path_planner_passes_where_the_arm_may_be_slow(monkeypatch, over, is_tried):
    clearance = ClearanceTable()
    asked = []

    def search(start, goals, free, **options):
        asked.append(bool(free(0.5 * (start + goals[:1]))[0]))

    monkeypatch.setattr(trajectory_adapter, "rrt_connect", search)
    kinematics = arm_kinematics(MODEL, "right")
    adapter = TrajectoryAdapter(
        MODEL,
        "right",
        np.linspace(START, GOAL, 50)[None],
        2.0,
        AdaptationParams(),
        clearance,
    )
    X_TG = RigidTransform(kinematics.hand_pose(GOAL))
    assert adapter.adapt(START, X_TG, Passage(clearance.slow + over), deform=False) is None
    assert asked == [is_tried]
