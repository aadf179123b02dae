"""Body poses at every frame, by forward kinematics of the recorded joints; no simulation."""

from dataclasses import dataclass

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Box, Rgba, SceneGraph, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex, RigidBody
from pydrake.systems.framework import Context

from pepper_drake.errors import InputError
from pepper_drake.models.objects import add_scene
from pepper_drake.models.pepper import add_pepper, hand_frame, posture_positions
from pepper_drake.playback.motion import Motion, Vector

FRAME_RATE = 30.0
"""Frames per second of a playback."""

_HAND_COLOR = (0.15, 0.55, 0.95, 1.0)
_AXES = np.eye(3)
_AXIS_LENGTH, _AXIS_WIDTH = 0.08, 0.006


@dataclass(frozen=True, eq=False)
class Part:
    """A shape S that is fixed to a body B.

    Attributes:
        name: Name, unique within the body.
        shape: The shape.
        X_BS: (4, 4) pose of the shape.
        color: RGBA.
    """

    name: str
    shape: Shape
    X_BS: Vector
    color: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class MovingBody:
    """A body B over F frames.

    Attributes:
        name: Name, unique among the bodies of a motion.
        is_robot: Whether the body is part of Pepper.
        parts: Shapes of the body.
        translations: (F, 3) of X_WB [m].
        quaternions: (F, 4) of X_WB, w, x, y, z.
    """

    name: str
    is_robot: bool
    parts: tuple[Part, ...]
    translations: Vector
    quaternions: Vector


@dataclass(frozen=True, eq=False)
class Frames:
    """A motion, sampled at the frames of a playback.

    Attributes:
        motion: The motion.
        times: (F,) since the first frame [s].
        clock: (F,) time of each frame in the motion [s].
        yaw: Heading of Pepper when the arm starts, from W's x axis [rad].
        bodies: All visible bodies.
        hand_W: (K, 3) the hand's path after the arm's start.
        shown_W: (M, 3) the demonstrated path, shifted to begin where the hand starts.
        cloud_W: (P, 3) the perceived obstacle cloud.
    """

    motion: Motion
    times: Vector
    clock: Vector
    yaw: float
    bodies: tuple[MovingBody, ...]
    hand_W: Vector
    shown_W: Vector
    cloud_W: Vector

    def at_frames(self, values: Vector) -> Vector:
        """Interpolates values (N,) at the motion's times to the frames (F,)."""
        return np.interp(self.clock, self.motion.times, values)


class RecordedModel:
    """Model of Pepper and the scene of a motion, for the recorded positions.

    Attributes:
        plant: The finalized plant; it is never simulated.
        scene_graph: The plant's shapes.
    """

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.plant: MultibodyPlant = MultibodyPlant(time_step=1e-3)
        self.scene_graph = SceneGraph()
        self.plant.RegisterAsSourceForSceneGraph(self.scene_graph)
        self._pepper: ModelInstanceIndex = add_pepper(self.plant)
        if motion.scene is not None:
            add_scene(self.plant, motion.scene)
        self.plant.Finalize()
        self._context: Context = self.plant.CreateDefaultContext()
        self._resting = self.plant.GetPositions(self._context)
        robot = (
            motion.scene.robot.positions()
            if motion.scene is not None
            else posture_positions("stand")
        )
        for name, value in robot.items():
            self._resting[self.column(name)] = value
        self._columns = {name: self.column(name) for name in motion.positions}

    def column(self, joint: str) -> int:
        """Returns the index of a one-degree-of-freedom joint in the plant's positions."""
        if not self.plant.HasJointNamed(joint):
            raise InputError(f'{self.motion.name}: there is no joint "{joint}"; record it again')
        return int(self.plant.GetJointByName(joint).position_start())

    def positions(self, times: Vector) -> Vector:
        """Returns the plant's positions (F, n) at times (F,), linear between the samples."""
        positions = np.tile(self._resting, (len(times), 1))
        for name, column in self._columns.items():
            positions[:, column] = np.interp(times, self.motion.times, self.motion.positions[name])
        return positions

    def frame_poses(self, frame: str, times: Vector) -> list[RigidTransform]:
        """Returns the poses X_WF of a frame of Pepper at times (F,)."""
        F, poses = self.plant.GetFrameByName(frame), []
        for positions in self.positions(times):
            self.plant.SetPositions(self._context, positions)
            poses.append(F.CalcPoseInWorld(self._context))
        return poses

    def bodies(self, times: Vector) -> tuple[MovingBody, ...]:
        """Returns all visible bodies, with their poses at times (F,)."""
        shown = [
            (body, parts)
            for index in range(self.plant.num_bodies())
            if (parts := self._parts(body := self.plant.get_body(BodyIndex(index))))
        ]
        translations = np.empty((len(shown), len(times), 3))
        quaternions = np.empty((len(shown), len(times), 4))
        for k, positions in enumerate(self.positions(times)):
            self.plant.SetPositions(self._context, positions)
            for j, (body, _) in enumerate(shown):
                X_WB = self.plant.EvalBodyPoseInWorld(self._context, body)
                translations[j, k] = X_WB.translation()
                quaternions[j, k] = X_WB.rotation().ToQuaternion().wxyz()
        return tuple(
            MovingBody(
                body.name(),
                body.model_instance() == self._pepper,
                parts,
                translations[j],
                quaternions[j],
            )
            for j, (body, parts) in enumerate(shown)
        )

    def _parts(self, body: RigidBody) -> tuple[Part, ...]:
        inspector = self.scene_graph.model_inspector()
        parts = []
        for geometry in self.plant.GetVisualGeometriesForBody(body):
            properties = inspector.GetIllustrationProperties(geometry)
            if properties is None:  # A shape for the cameras only.
                continue
            color = properties.GetPropertyOrDefault("phong", "diffuse", Rgba(0.9, 0.9, 0.9, 1.0))
            parts.append(
                Part(
                    inspector.GetName(geometry).replace("::", "_"),
                    inspector.GetShape(geometry),
                    inspector.GetPoseInFrame(geometry).GetAsMatrix4(),
                    tuple(color.rgba.tolist()),
                )
            )
        return tuple(parts)


def replay_frames(motion: Motion, *, from_arm: bool = False) -> Frames:
    """Computes all poses, at 30 frames per second.

    Args:
        motion: A loaded motion.
        from_arm: Whether to begin at the arm's start, not at the robot's.
    """
    model = RecordedModel(motion)
    begin = motion.arm_starts if from_arm else float(motion.times[0])
    count = max(2, 1 + int(np.ceil((motion.times[-1] - begin) * FRAME_RATE)))
    times = np.arange(count) / FRAME_RATE
    clock = np.minimum(begin + times, motion.times[-1])
    bodies = model.bodies(clock)
    (X_WT,) = model.frame_poses("torso", np.array([motion.arm_starts]))
    if motion.hand_T is None:
        moving = np.linspace(
            motion.arm_starts,
            motion.times[-1],
            max(2, round((motion.times[-1] - motion.arm_starts) * FRAME_RATE)),
        )
        poses = model.frame_poses(hand_frame(motion.arm), moving)
        hand_W = np.array([X_WH.translation() for X_WH in poses])
    else:
        hand_W = _in_world(X_WT, motion.hand_T)
        bodies += (_bare_hand(motion, X_WT, clock),)
    shown = motion.shown_T
    return Frames(
        motion=motion,
        times=times,
        clock=clock,
        yaw=float(RollPitchYaw(X_WT.rotation()).yaw_angle()),
        bodies=bodies,
        hand_W=hand_W,
        shown_W=_in_world(X_WT, shown - shown[0]) - X_WT.translation() + hand_W[0]
        if len(shown)
        else shown,
        cloud_W=_in_world(X_WT, motion.cloud_T),
    )


def _in_world(X_WT: RigidTransform, points_T: Vector) -> Vector:
    return points_T @ X_WT.rotation().matrix().T + X_WT.translation()


def _bare_hand(motion: Motion, X_WT: RigidTransform, clock: Vector) -> MovingBody:
    """Returns a ball, with axes if the orientation is known, for a motion without arm joints."""
    assert motion.hand_T is not None
    positions_T = np.column_stack([np.interp(clock, motion.times, p) for p in motion.hand_T.T])
    parts = [Part("hand", Sphere(0.025), np.eye(4), _HAND_COLOR)]
    quaternions = np.tile(X_WT.rotation().ToQuaternion().wxyz(), (len(clock), 1))
    if motion.hand_rotations_T is not None:
        nearest = np.searchsorted(motion.times, clock).clip(max=len(motion.times) - 1)
        quaternions = np.array(
            [
                (X_WT.rotation() @ RotationMatrix(Quaternion(q / np.linalg.norm(q))))
                .ToQuaternion()
                .wxyz()
                for q in motion.hand_rotations_T[nearest]
            ]
        )
        for axis, name in zip(_AXES, "xyz", strict=True):
            X = np.eye(4)
            X[:3, 3] = _AXIS_LENGTH / 2 * axis
            size = _AXIS_WIDTH + (_AXIS_LENGTH - _AXIS_WIDTH) * axis
            parts.append(Part(f"{name}_axis", Box(*size), X, (*(0.85 * axis), 1.0)))
    return MovingBody("hand", True, tuple(parts), _in_world(X_WT, positions_T), quaternions)
