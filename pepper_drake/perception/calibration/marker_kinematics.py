"""Projection of a marker on the hand into the head cameras' images, with errors as parameters.

The kinematic chain runs from the camera through the head's two joints to the torso, and through the
arm's five to the hand. Its errors are parameters: encoder offsets, backlash, the cameras'
extrinsics and focal lengths, and the marker's pose on the hand.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.spatial.transform import Rotation

from pepper_drake.learning.demonstrations.arm_chain import arm_chain
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.robot_wear import WearSizes
from pepper_drake.models.scene import HandMarker
from pepper_drake.perception.calibration.calibrated_cameras import HEAD_CAMERA_MODELS
from pepper_drake.perception.cameras.camera import HeadCamera, moved_camera
from pepper_drake.perception.gaze.head_aiming import P_T_NECK
from pepper_drake.perception.goal.marker import marker_corners

Vector = npt.NDArray[np.float64]

COLOR_CAMERAS = ("camera_top", "camera_bottom")
"""The cameras that see markers, by the station's name."""

_JOINTS = 7
_OF_CAMERA = 7
_AXES = ("x", "y", "z")
_ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class MarkerSighting:
    """The marker in one image, with the joints measured at that time.

    Attributes:
        camera: The station's name of the camera.
        joints: Encoders of head and arm (7,) [rad].
        approach: Direction in which each joint last moved (7,), 1 or -1; 0 if unknown.
        corners: Pixel coordinates (4, 2) of the marker's corners.
        corner_sigma: Standard deviation of one coordinate [pixel].
        posture: Number of the posture.
    """

    camera: str
    joints: Vector
    approach: Vector
    corners: Vector
    corner_sigma: float
    posture: int


@dataclass(frozen=True)
class PriorSigmas:
    """Prior standard deviations of the errors.

    A uniform distribution within ± a has a / sqrt(3); a vector of uniform length up to a and
    uniform direction has a / 3 in each coordinate.
    """

    offset: float
    slack: float
    camera_position: float
    camera_rotation: float
    focal: float
    marker_position: float = 0.005
    """Standard deviation of the marker's position on the hand, in each coordinate [m]."""
    marker_rotation: float = 0.05
    """Standard deviation of its rotation, in each coordinate [rad]."""

    @classmethod
    def of_wear(cls, sizes: WearSizes | None = None) -> "PriorSigmas":
        """Returns those of a robot with the usual wear."""
        sizes = WearSizes() if sizes is None else sizes
        return cls(
            offset=sizes.encoder_offset / np.sqrt(3.0),
            slack=sizes.backlash,
            camera_position=sizes.camera_position / 3.0,
            camera_rotation=sizes.camera_angle / 3.0,
            focal=sizes.focal / np.sqrt(3.0),
        )


class MarkerModel:
    """Predicts the marker's corners in the images from parameters (n,) of the whole chain.

    The parameters are, in this order: encoder offsets (7) of head and arm [rad]; backlash (7) from
    end to end [rad]; for each camera position (3) [m], rotation (3) [rad] and relative error of its
    focal length; the marker's position (3) [m] and rotation vector (3) [rad] on the hand. All are
    errors relative to the model.

    Attributes:
        joint_names: The seven joints.
        cameras: The station's names of the cameras.
        names: Names of the parameters (n,).
        prior_sigmas: Their prior standard deviations (n,).
    """

    def __init__(
        self, arm: str, marker: HandMarker, cameras: Sequence[str], prior: PriorSigmas
    ) -> None:
        """Makes the model.

        Args:
            arm: "left" or "right": the arm that holds the marker.
            marker: The marker.
            cameras: The station's names of the cameras that see it.
            prior: Prior standard deviations of the errors.
        """
        self.joint_names = (*JOINT_GROUPS["head"], *arm_joints(arm))
        self.cameras = tuple(cameras)
        self.marker = marker
        self._chain = arm_chain(arm)
        # Most finite differences for the Jacobian do not change the arm.
        self._hand = functools.lru_cache(maxsize=8)(functools.partial(_hand_poses, arm))
        self._corners = marker_corners(marker.size)
        names = [f"{joint} offset" for joint in self.joint_names]
        names += [f"{joint} slack" for joint in self.joint_names]
        sigmas = [prior.offset] * _JOINTS + [prior.slack] * _JOINTS
        for camera in self.cameras:
            names += [f"{camera} {axis}" for axis in (*_AXES, *_ANGLES, "focal length")]
            sigmas += [prior.camera_position] * 3 + [prior.camera_rotation] * 3 + [prior.focal]
        names += [f"marker {axis}" for axis in (*_AXES, *_ANGLES)]
        sigmas += [prior.marker_position] * 3 + [prior.marker_rotation] * 3
        self.names = tuple(names)
        self.prior_sigmas = np.array(sigmas)

    @property
    def arm_limits(self) -> tuple[Vector, Vector]:
        """Returns the lower and upper limits of the arm's joints (5,) [rad]."""
        return self._chain.lower, self._chain.upper

    def marker_places(self, arm_joints: Vector) -> Vector:
        """Returns the nominal p_TM (N, 3) [m] of the marker at the arm's joints (N, 5) [rad]."""
        p_TH, R_TH = self._hand(arm_joints.tobytes())
        return np.asarray(p_TH + R_TH @ self.marker.pose().translation())

    def offsets(self, parameters: Vector) -> Vector:
        """Returns the offset of each encoder (7,) [rad]."""
        return parameters[:_JOINTS]

    def slacks(self, parameters: Vector) -> Vector:
        """Returns the backlash of each joint from end to end (7,) [rad]."""
        return parameters[_JOINTS : 2 * _JOINTS]

    def camera_slice(self, camera: str) -> slice:
        """Returns the indices of a camera's seven parameters."""
        start = 2 * _JOINTS + _OF_CAMERA * self.cameras.index(camera)
        return slice(start, start + _OF_CAMERA)

    def camera(self, parameters: Vector, name: str) -> HeadCamera:
        """Returns a camera with its errors applied."""
        x, y, z, roll, pitch, yaw, focal = parameters[self.camera_slice(name)].tolist()
        return moved_camera(HEAD_CAMERA_MODELS[name], (x, y, z), (roll, pitch, yaw), 1.0 + focal)

    def marker_pose(self, parameters: Vector) -> RigidTransform:
        """Returns X_HM of the marker with its errors applied."""
        turn = Rotation.from_rotvec(parameters[-3:]).as_matrix()
        X = self.marker.pose()
        R = X.rotation().matrix() @ turn
        return RigidTransform(np.block([[R, (X.translation() + parameters[-6:-3])[:, None]]]))

    def marker_poses(
        self, parameters: Vector, camera: str, joints: Vector, approach: Vector
    ) -> tuple[Vector, Vector]:
        """Returns the marker's poses in a camera's frame.

        Args:
            parameters: (n,).
            camera: The camera.
            joints: Encoders of head and arm (N, 7) [rad].
            approach: Direction in which each joint last moved (N, 7).

        Returns:
            R_CM (N, 3, 3) and p_CM (N, 3) [m].
        """
        # A motor that last moved in one direction leads its joint by half the backlash.
        true_joints = joints - self.offsets(parameters) - 0.5 * approach * self.slacks(parameters)
        p_TH, R_TH = self._hand(true_joints[:, 2:].tobytes())
        X_HM = self.marker_pose(parameters)
        R_TM = R_TH @ X_HM.rotation().matrix()
        p_TM = p_TH + R_TH @ X_HM.translation()
        R_THead = Rotation.from_euler("ZY", true_joints[:, :2]).as_matrix()
        X_HeadC = self.camera(parameters, camera).X_HeadC
        R_TC = R_THead @ X_HeadC.rotation().matrix()
        p_TC = P_T_NECK + R_THead @ X_HeadC.translation()
        R_CT = np.swapaxes(R_TC, 1, 2)
        return R_CT @ R_TM, np.einsum("nij,nj->ni", R_CT, p_TM - p_TC)

    def project(self, parameters: Vector, camera: str, joints: Vector, approach: Vector) -> Vector:
        """Returns the pixel coordinates (N, 4, 2) of the marker's corners; see `marker_poses`."""
        R_CM, p_CM = self.marker_poses(parameters, camera, joints, approach)
        p_CK = np.einsum("nij,kj->nki", R_CM, self._corners) + p_CM[:, None]
        return self.camera(parameters, camera).intrinsics.project(p_CK)


def _hand_poses(arm: str, joints: bytes) -> tuple[Vector, Vector]:
    """Returns p_TH (N, 3) [m] and R_TH (N, 3, 3) for the bytes of the joints (N, 5) [rad]."""
    p_TH, q_TH = arm_chain(arm).hand(np.frombuffer(joints).reshape(-1, 5))
    return p_TH, Rotation.from_quat(q_TH, scalar_first=True).as_matrix()
