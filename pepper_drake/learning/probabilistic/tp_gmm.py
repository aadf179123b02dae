"""Task-parametrised Gaussian mixture: a motion described in several frames, which may move.

Calinon, "A tutorial on task-parameterized movement learning and retrieval", Intelligent Service
Robotics 9 (2016), DOI 10.1007/s11370-015-0187-9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.alignment import align
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.probabilistic.gaussian_mixture import GaussianMixture
from pepper_drake.learning.probabilistic.shared_mixture import fit_shared_mixtures
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TaskFrame:
    """A frame F of a motion, such as that of the start or of the goal object.

    Attributes:
        rotation: R_TF, shape (3, 3).
        position: p_TF, shape (3,) [m].
    """

    rotation: Array
    position: Array

    __repr__ = short_repr

    def to_frame(self, positions: Array) -> Array:
        """Returns positions (N, 3), given in T, in this frame."""
        return np.asarray((positions - self.position) @ self.rotation)


def start_and_goal(demonstration: Demonstration) -> tuple[TaskFrame, TaskFrame]:
    """Returns frames at the first and the last position, with T's axes."""
    axes = np.eye(3)
    return (
        TaskFrame(axes, demonstration.positions[0]),
        TaskFrame(axes, demonstration.positions[-1]),
    )


@dataclass(frozen=True)
class TaskParameterizedMixture:
    """One mixture of (s, y) per frame, with shared priors; s is the time in [0, 1].

    p(v) = sum_k pi_k N_k(s) prod_j N_k(y^(j) | s), y^(j) the position in frame j. The time is the
    same in all frames and counts once: as a coordinate of each, two frames that disagree on the
    position would settle on another time.

    Attributes:
        mixtures: One per frame, with the same priors, of 1 + 3 coordinates.
    """

    mixtures: tuple[GaussianMixture, ...]

    __repr__ = short_repr

    def in_frames(self, frames: Sequence[TaskFrame]) -> GaussianMixture:
        """Returns the mixture of (s, y) in T for the current frames.

        For each component it is the product of the frames' conditionals at s: with lines l_j(s) and
        residual covariances C_j, the mean C sum_j C_j^-1 l_j(s) and the covariance
        C = (sum_j C_j^-1)^-1. Frames in which the demonstrations agreed weigh more.

        Raises:
            InputError: The number of frames differs from the demonstrations'.
        """
        if len(frames) != len(self.mixtures):
            raise InputError(f"{len(frames)} frames given, {len(self.mixtures)} were learned from.")
        gains, offsets, precisions = [], [], []
        for mixture, frame in zip(self.mixtures, frames, strict=True):
            matrix = np.eye(4)
            matrix[1:, 1:] = frame.rotation
            seen = mixture.transformed(matrix, np.concatenate([[0.0], frame.position]))
            gain, offset, residual = seen.experts(num_inputs=1)
            gains.append(gain[:, :, 0])
            offsets.append(offset)
            precisions.append(np.linalg.inv(residual))
        residual = np.linalg.inv(np.sum(precisions, axis=0))
        weights = residual @ np.array(precisions)
        gain = np.einsum("jkab,jkb->ka", weights, np.array(gains))
        offset = np.einsum("jkab,jkb->ka", weights, np.array(offsets))
        time_mean = self.mixtures[0].means[:, 0]
        time_variance = self.mixtures[0].covariances[:, 0, 0]
        # The line with its residual as a Gaussian of (s, y).
        lift = np.concatenate([np.ones((len(gain), 1)), gain], axis=1)
        covariances = time_variance[:, None, None] * lift[:, :, None] * lift[:, None, :]
        covariances[:, 1:, 1:] += residual
        means = np.column_stack([time_mean, offset + gain * time_mean[:, None]])
        return GaussianMixture(self.mixtures[0].priors, means, covariances)


def fit_task_parameterized(
    demonstrations: Sequence[Demonstration],
    frames: Sequence[Sequence[TaskFrame]],
    *,
    num_components: int = 10,
    warp: bool = False,
) -> TaskParameterizedMixture:
    """Fits all frames' mixtures at once by expectation maximisation.

    The component is shared by all demonstrations at each moment (see `shared_mixture`): on new
    frames the error is a quarter of that with a component per sample.

    Args:
        demonstrations: At least one; their variability tells which frame matters when.
        frames: Per demonstration, its frames, always the same number.
        num_components: K.
        warp: As in `align`.

    Raises:
        InputError: Numbers of frames and demonstrations do not agree.
    """
    motions = align(demonstrations, num_samples=100, warp=warp)
    points = np.array([motion.positions for motion in motions])
    return fit_points(np.linspace(0, 1, 100), points, frames, num_components=num_components)


def fit_points(
    relative_times: Array,
    points: Array,
    frames: Sequence[Sequence[TaskFrame]],
    *,
    num_components: int,
) -> TaskParameterizedMixture:
    """Fits as `fit_task_parameterized` does, for aligned points.

    Args:
        relative_times: s, shape (N,).
        points: Shape (M, N, 3) [m].
        frames: M sequences of frames.
        num_components: K.
    """
    if len(frames) != len(points) or len({len(of_one) for of_one in frames}) != 1 or not frames[0]:
        raise InputError("frames: give each demonstration its frames, always the same number.")
    # One length for all frames: their positions must not affect the clustering.
    length = float(points.std(axis=1).mean()) or 1.0
    scale = np.array([relative_times.std(), length, length, length])
    clock = np.tile(relative_times, len(points))
    views = []
    for frame_of_each in zip(*frames, strict=True):
        seen = [frame.to_frame(p) for frame, p in zip(frame_of_each, points, strict=True)]
        views.append(np.column_stack([clock, np.vstack(seen)]) / scale)
    mixtures = fit_shared_mixtures(views, len(points), num_components)
    return TaskParameterizedMixture(
        tuple(mixture.transformed(np.diag(scale), np.zeros(4)) for mixture in mixtures)
    )
