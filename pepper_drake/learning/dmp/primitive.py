"""Movement primitives: learn a motion from demonstrations, perform it with another goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.approximators.registry import LinearForcingModel
from pepper_drake.learning.demonstrations.conditioning import hermite
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.demonstrations.refusals import refuse_impossible, refuse_unlike
from pepper_drake.learning.dmp.num_basis import (
    COMPARED,
    MOST_SAMPLES,
    choose_num_basis,
    longest_step,
)
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.learning.dmp.orientation import OrientationAttractor, learn_orientation
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.learning.dmp.posture import PostureProfile, learn_posture
from pepper_drake.learning.dmp.rollout import (
    Motion,
    PathBatch,
    number_of_steps,
    orientation_motion,
    undisturbed_motion,
    undisturbed_motions,
)
from pepper_drake.learning.dmp.rollout_arguments import (
    GoalMotion,
    check_seconds,
    coupling_and_field,
    goal_function,
    quaternion,
    vector,
)
from pepper_drake.learning.dmp.stepwise_rollout import integrate
from pepper_drake.learning.dmp.transformation import (
    MotionSample,
    TransformationModel,
    learn_attractor,
)
from pepper_drake.learning.phase import ALPHA_Z, phase_at, relative_time_at
from pepper_drake.short_repr import figure_view, short_repr

Array = npt.NDArray[np.float64]

DEFAULT_APPROXIMATOR = "trajectory_slopes"
DEFAULT_SCALING = "gradual"
FIT_TOLERANCE = 0.005
"""Deviation [m] of a fit from its demonstration above which the number of basis functions is
doubled, if it is left open."""

_MOST_STEPS = 10_000_000


@dataclass(frozen=True, eq=False)
class Path3D(Motion):
    """Result of a rollout: a `Motion` of D = 3 coordinates [m], with orientation and joints.

    Attributes:
        rotations: (N, 4) unit quaternions w, x, y, z, where the primitive has an orientation.
        angular_velocities: (N, 3) [rad/s], expressed in the frame of the motion.
        joints: (N, J) nominal joints [rad], where the primitive has them.
    """

    __repr__ = short_repr

    rotations: Array | None = None
    angular_velocities: Array | None = None
    joints: Array | None = None


@dataclass(frozen=True, eq=False)
class MovementPrimitive:
    """A motion of the hand: translation, and orientation and joints if demonstrated, in one phase.

    Attributes:
        translation: The transformation system of the position.
        duration: Of the demonstration, tau [s].
        path_length: Of the demonstration [m].
        orientation: The transformation system of the orientation, or None.
        posture: Nominal joints as a function of the phase, or None.
        approximator: The approximator's name.
        name: Of the demonstration.
    """

    __repr__ = short_repr
    _repr_html_ = figure_view

    translation: TransformationModel
    duration: float
    path_length: float
    orientation: OrientationAttractor | None = None
    posture: PostureProfile | None = None
    approximator: str = DEFAULT_APPROXIMATOR
    name: str = "primitive"

    @classmethod
    def fit(
        cls,
        demonstrations: Demonstration | Sequence[Demonstration],
        approximator: str = DEFAULT_APPROXIMATOR,
        num_basis: int | None = None,
        scaling: str = DEFAULT_SCALING,
        orientation: str = "log_map",
        alpha_z: float = ALPHA_Z,
        seed: int = 0,
        check: bool = True,
    ) -> Self:
        """Learns one primitive from one or several demonstrations, aligned in phase.

        Where samples are further apart than basis functions, they are interpolated (see
        `Demonstration.filled`), so that the motion stays near them in between.

        Args:
            demonstrations: One, or several of the same motion.
            approximator: How the forcing term is learned; see `approximator_names`.
            num_basis: Number of basis functions. Left out, it follows the data: 40, at most the
                number of samples, doubled while the motion deviates from a single demonstration by
                more than `FIT_TOLERANCE`.
            scaling: How the motion adapts to start and goal; see `scaling`.
            orientation: `log_map`, or `angles` for the report's three angles.
            alpha_z: Constant of the spring.
            seed: For approximators with random starts.
            check: Refuse implausible demonstrations, or those of different movements (see
                `demonstrations.check`); False for synthetic motions.

        Raises:
            InputError: A name is unknown, a number out of range, or a demonstration unusable.
        """
        demos = (
            [demonstrations] if isinstance(demonstrations, Demonstration) else list(demonstrations)
        )
        if not demos or not all(isinstance(demo, Demonstration) for demo in demos):
            raise InputError("demonstrations: none given; it takes one Demonstration or several")
        if not alpha_z > 0.0:
            raise InputError(f"alpha_z: {alpha_z} is not positive")
        if check:
            for demo in demos:
                refuse_impossible(demo)
            refuse_unlike(demos)
        if num_basis is not None:
            return cls._fit(demos, approximator, num_basis, scaling, orientation, alpha_z, seed)

        def deviation(learned: MovementPrimitive) -> float:
            if len(demos) > 1:
                return 0.0  # The mean is learned, which differs from each.
            return learned.distance(demos[0].filled(demos[0].duration / COMPARED))

        return choose_num_basis(
            min(len(demo.times) for demo in demos),
            lambda number: cls._fit(
                demos, approximator, number, scaling, orientation, alpha_z, seed
            ),
            deviation,
            FIT_TOLERANCE,
        )

    @classmethod
    def _fit(
        cls,
        demonstrations: list[Demonstration],
        approximator: str,
        num_basis: int,
        scaling: str,
        orientation: str,
        alpha_z: float,
        seed: int,
    ) -> Self:
        demos = [demo.thinned(MOST_SAMPLES) for demo in demonstrations]
        demos = [demo.filled(longest_step(demo.times, num_basis)) for demo in demos]
        samples = [motion_sample(demo) for demo in demos]
        times = [sample.times for sample in samples]
        turning = None
        rotations = [demo.rotations for demo in demos if demo.rotations is not None]
        if len(rotations) == len(demos):
            turning = learn_orientation(
                times, rotations, orientation, approximator, num_basis, alpha_z, seed
            )
        return cls(
            translation=learn_attractor(samples, approximator, num_basis, scaling, alpha_z, seed),
            duration=float(np.mean([demo.duration for demo in demos])),
            path_length=float(np.mean([demo.path_length for demo in demos])),
            orientation=turning,
            posture=learn_posture(demos, times, num_basis),
            approximator=approximator,
            name=demos[0].name,
        )

    def distance(self, demonstration: Demonstration) -> float:
        """Returns the largest deviation of the motion from a demonstration, at its samples [m]."""
        path = self.rollout(
            time_step=demonstration.duration / COMPARED,
            start=demonstration.positions[0],
            goal=demonstration.positions[-1],
            duration=demonstration.duration,
            start_velocity=demonstration.velocities[0],
        )
        times = demonstration.times - demonstration.times[0]
        # With velocities: linear interpolation would err more in quick parts than the fit.
        own = hermite(path.times, path.positions, path.velocities)(times)
        gaps = np.linalg.norm(own - demonstration.positions, axis=1)
        return float(gaps.max())

    @property
    def start(self) -> Array:
        """(3,) the demonstration's first position [m]."""
        return self.translation.frame.start

    @property
    def goal(self) -> Array:
        """(3,) the demonstration's last position [m]."""
        return self.translation.frame.goal

    @property
    def num_basis(self) -> int:
        """Number of basis functions of the translation."""
        return self.translation.model.num_basis

    @property
    def weights(self) -> Array:
        """(K, 3) weights of the translation's forcing term.

        K is the number of basis functions, or twice that where each has a slope: first all
        constants, then all slopes.

        Raises:
            InputError: The approximator's forcing term is not linear in weights.
        """
        return self._linear_model().weights

    def with_weights(self, weights: npt.ArrayLike) -> Self:
        """Returns the primitive with other weights, of a shape as in `rollout_batch`."""
        model = self._linear_model()
        full = self._full_weights(np.asarray(weights, dtype=float)[None])[0]
        return replace(self, translation=self.translation.with_model(model.with_weights(full)))

    def rollout(
        self,
        time_step: float = 0.01,
        start: npt.ArrayLike | None = None,
        goal: npt.ArrayLike | GoalMotion | None = None,
        duration: float | None = None,
        obstacles: npt.ArrayLike | PointCloudDistance | None = None,
        coupling: str | Coupling = "barrier",
        start_velocity: npt.ArrayLike | None = None,
        goal_velocity: npt.ArrayLike | GoalMotion | None = None,
        start_rotation: npt.ArrayLike | None = None,
        goal_rotation: npt.ArrayLike | None = None,
        start_angular_velocity: npt.ArrayLike | None = None,
        settle: float = 0.0,
    ) -> Path3D:
        """Performs the motion.

        Args:
            time_step: Between samples [s].
            start: (3,) initial position [m]; the demonstration's start if left out.
            goal: (3,) [m], or a function of the time [s] for one that moves; the demonstration's
                goal if left out. With a moving goal the duration is extended in proportion to its
                displacement: each metre adds the demonstration's time for a metre of its path.
            duration: tau [s]; the demonstration's if left out.
            obstacles: (P, 3) points [m], or a distance field of them.
            coupling: `barrier`, `report`, or a coupling with other constants.
            start_velocity: (3,) [m/s]; if left out, that of the demonstration's start.
            goal_velocity: (3,) [m/s] or a function of the time [s]: known velocity of the goal.
            start_rotation: (4,) unit quaternion; the demonstration's if left out.
            goal_rotation: (4,) unit quaternion; the demonstration's if left out.
            start_angular_velocity: (3,) [rad/s]; if left out, that of the demonstration's start.
            settle: Time to continue after the motion's end, in tau.

        Returns:
            The path, from time 0 to the first sample at or after the motion's end. With
            obstacles the motion may take longer than `duration`: near them the phase slows down.

        Raises:
            InputError: A value is not finite, not positive where it must be, or of the wrong shape.
        """
        tau, step, settle = self._check(time_step, duration, settle)
        y0 = vector(start, self.start, 3, "start")
        if goal is None or not callable(goal):
            g0 = vector(goal, self.goal, 3, "goal")
        else:
            g0 = vector(goal(0.0), self.goal, 3, "goal")
        v0 = vector(
            start_velocity, self.translation.start_velocity(y0, g0, tau), 3, "start_velocity"
        )
        if obstacles is None and not callable(goal) and goal_velocity is None:
            steps = number_of_steps(tau * (1.0 + settle), step)
            motion = undisturbed_motion(self.translation, y0, g0, v0, tau, step, steps)
        else:
            motion = integrate(
                self.translation,
                np.stack((y0, v0)),
                goal_function(goal, goal_velocity, g0),
                tau,
                step,
                settle,
                *coupling_and_field(coupling, obstacles),
                self.duration / self.path_length if self.path_length > 0.0 else 0.0,
            )
        return self._complete(motion, start_rotation, goal_rotation, start_angular_velocity)

    def rollout_batch(
        self,
        weights: npt.ArrayLike,
        time_step: float = 0.01,
        start: npt.ArrayLike | None = None,
        goal: npt.ArrayLike | None = None,
        duration: float | None = None,
        obstacles: npt.ArrayLike | PointCloudDistance | None = None,
        coupling: str | Coupling = "barrier",
        start_velocity: npt.ArrayLike | None = None,
        settle: float = 0.0,
    ) -> PathBatch:
        """Performs the translation with S sets of weights at once.

        Args:
            weights: (S, K, 3), K rows as in `weights`; or (S, num_basis, 3), which leaves the
                slopes of an approximator with slopes as they were learned.
            time_step: This and the others as in `rollout`.
            start: (3,) [m].
            goal: (3,) [m].
            duration: tau [s].
            obstacles: (P, 3) points [m], or a distance field of them.
            coupling: `barrier`, `report`, or a coupling with other constants.
            start_velocity: (3,) [m/s].
            settle: In tau.

        Returns:
            The paths; positions (S, N, 3). With obstacles all continue until the slowest has ended.

        Raises:
            InputError: As in `rollout`, or the approximator is not linear in weights.
        """
        tau, step, settle = self._check(time_step, duration, settle)
        sets = self._full_weights(np.asarray(weights, dtype=float))
        y0 = vector(start, self.start, 3, "start")
        g = vector(goal, self.goal, 3, "goal")
        v0 = vector(
            start_velocity, self.translation.start_velocity(y0, g, tau), 3, "start_velocity"
        )
        if obstacles is None:
            steps = number_of_steps(tau * (1.0 + settle), step)
            return undisturbed_motions(self.translation, sets, y0, g, v0, tau, step, steps)
        return PathBatch.of(
            integrate(
                self.translation,
                np.broadcast_to(np.stack((y0, v0)), (len(sets), 2, 3)),
                g,
                tau,
                step,
                settle,
                *coupling_and_field(coupling, obstacles),
                0.0,
                sets,
            )
        )

    def phase_at(self, times: npt.ArrayLike, duration: float | None = None) -> Array:
        """Returns the phase at times [s] of an undisturbed motion."""
        tau = self.duration if duration is None else duration
        return phase_at(np.asarray(times, dtype=float) / tau, self.translation.alpha_x)

    def save(self, path: str | Path) -> None:
        """Writes the primitive as one readable YAML file; see `primitive_files`."""
        from pepper_drake.learning.dmp.primitive_files import write_primitive

        write_primitive(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> MovementPrimitive:
        """Reads a primitive; its rollouts are bit for bit those of the one that was saved.

        Raises:
            InputError: With file, field and what to do.
        """
        from pepper_drake.learning.dmp.primitive_files import read_primitive

        return read_primitive(Path(path))

    def _linear_model(self) -> LinearForcingModel:
        model = self.translation.linear_model
        if model is None:
            raise InputError(
                f"approximator: '{self.approximator}' has no weights to vary; fit with another"
            )
        return model

    def _full_weights(self, weights: Array) -> Array:
        """Returns (S, K, 3): slopes filled in where only the constants were given."""
        own = self._linear_model().weights
        if weights.ndim == 3 and weights.shape[1:] == own.shape:
            return weights
        if weights.ndim == 3 and weights.shape[1:] == (self.num_basis, 3):
            rest = own[self.num_basis :]
            return np.concatenate(
                (weights, np.broadcast_to(rest, (len(weights), *rest.shape))), axis=1
            )
        raise InputError(
            f"weights: shape {weights.shape}; give (S, {own.shape[0]}, 3)"
            f" or (S, {self.num_basis}, 3)"
        )

    def _check(
        self, time_step: float, duration: float | None, settle: float
    ) -> tuple[float, float, float]:
        try:
            tau = self.duration if duration is None else float(duration)
            time_step, settle = float(time_step), float(settle)
        except (TypeError, ValueError):
            raise InputError("duration, time_step and settle must be numbers") from None
        check_seconds(duration=tau, time_step=time_step)
        if not (np.isfinite(settle) and settle >= 0.0):
            raise InputError(f"settle: {settle} is negative or not finite; give it in tau")
        if tau * (1.0 + settle) / time_step > _MOST_STEPS:
            raise InputError(
                f"time_step: {time_step:g} s makes more than {_MOST_STEPS} samples of {tau:g} s; "
                "give a longer one"
            )
        return tau, time_step, settle

    def _complete(
        self,
        motion: Motion,
        start_rotation: npt.ArrayLike | None,
        goal_rotation: npt.ArrayLike | None,
        start_angular_velocity: npt.ArrayLike | None = None,
    ) -> Path3D:
        path = Path3D(**vars(motion))
        if self.orientation is not None:
            q0 = quaternion(start_rotation, self.orientation.start, "start_rotation")
            qg = quaternion(goal_rotation, self.orientation.goal, "goal_rotation")
            turning = None
            if start_angular_velocity is not None:
                turning = vector(start_angular_velocity, q0[1:], 3, "start_angular_velocity")
            rotations, velocities = orientation_motion(self.orientation, q0, qg, motion, turning)
            path = replace(path, rotations=rotations, angular_velocities=velocities)
        if self.posture is not None:
            joints = self.posture.at(relative_time_at(motion.phases, self.translation.alpha_x))
            path = replace(path, joints=joints)
        return path


def motion_sample(demo: Demonstration) -> MotionSample:
    """Returns a demonstration's translation in relative time."""
    tau = demo.duration
    return MotionSample(
        (demo.times - demo.times[0]) / tau,
        demo.positions,
        demo.velocities * tau,
        demo.accelerations * tau**2,
    )
