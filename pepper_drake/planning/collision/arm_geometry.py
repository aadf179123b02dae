"""Where an arm's hand and spheres are, for many joint positions at once."""

import threading

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.models.pepper import hand_frame
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance

Vector = npt.NDArray[np.float64]


class ArmGeometry:
    """Forward kinematics of one arm in the torso frame T, with the arm as spheres.

    Immutable but for a scratch context, of which each thread has its own.

    Attributes:
        arm: "left" or "right".
        kinematics: The same for very many joint positions at once.
        shapes: Its collision shapes.
        spheres: The arm's spheres, upper arm to hand.
    """

    def __init__(self, model: ControlModel, arm: str) -> None:
        self.arm = arm
        self.kinematics = arm_kinematics(model, arm)
        self.shapes = ExactDistance(model, self.kinematics)
        self.spheres = self.kinematics.spheres
        self._model = model
        self._torso = model.plant.GetFrameByName("torso")
        self._hand = model.plant.GetFrameByName(hand_frame(arm))
        self._index = model.position_indices(arm_joints(arm))
        self._scratch = threading.local()

    def _context(self) -> Context:
        """This thread's scratch context; making one costs more than most calls."""
        if not hasattr(self._scratch, "context"):
            self._scratch.context = self._model.create_context()
        return self._scratch.context

    def hand_pose(self, joint_position: Vector) -> RigidTransform:
        """X_TH for the arm's joints (5,) [rad]."""
        context = self._context()
        q = np.zeros(self._model.plant.num_positions())
        q[self._index] = joint_position
        self._model.plant.SetPositions(context, q)
        return self._hand.CalcPose(context, self._torso)

    def sphere_centers(self, joint_positions: Vector) -> Vector:
        """Centres (N, S, 3) of the spheres in T, m, for joints (N, 5) [rad]."""
        poses = self.kinematics.poses(joint_positions)
        return self.kinematics.sphere_centers(poses).transpose(2, 1, 0)

    def clearances(self, joint_positions: Vector, field: PointCloudDistance) -> Vector:
        """Least distance (N,) of the arm to a cloud in T [m]; see `ExactDistance`."""
        return self.shapes.clearances(joint_positions, field)
