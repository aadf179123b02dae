"""Movement primitives in joint space, of any number of joints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import write_atomically
from pepper_drake.learning.approximators.registry import get_approximator
from pepper_drake.learning.demonstrations.arm_chain import ARMS, arm_chain
from pepper_drake.learning.demonstrations.conditioning import (
    careful,
    evenly_chosen,
    fill_times,
    hermite,
    interpolant,
    strays,
)
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.dmp.num_basis import (
    COMPARED,
    MOST_SAMPLES,
    choose_num_basis,
    longest_step,
)
from pepper_drake.learning.dmp.primitive import (
    DEFAULT_APPROXIMATOR,
    DEFAULT_SCALING,
    MovementPrimitive,
)
from pepper_drake.learning.dmp.rollout import number_of_steps, undisturbed_motion
from pepper_drake.learning.dmp.rollout_arguments import check_seconds, vector
from pepper_drake.learning.dmp.transformation import (
    MotionSample,
    TransformationModel,
    learn_attractor,
)
from pepper_drake.learning.phase import ALPHA_Z
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

_FEWEST = 4
FIT_TOLERANCE = 0.02
"""Deviation [rad] of a fit above which the number of basis functions is doubled, if it is left
open."""


def is_joint_primitive(path: str | Path) -> bool:
    """Tells whether a file holds a joint-space primitive.

    Raises:
        InputError: The file cannot be read as a primitive.
    """
    from pepper_drake.learning.dmp.primitive_files import read_fields

    return "joints" in read_fields(Path(path)).data


@dataclass(frozen=True, eq=False)
class JointPath:
    """Result of a rollout.

    Attributes:
        times: (N,) [s].
        joints: (N, J) [rad].
        velocities: (N, J) [rad/s].
        accelerations: (N, J) [rad/s²].
        phases: (N,).
    """

    times: Array
    joints: Array
    velocities: Array
    accelerations: Array
    phases: Array


@dataclass(frozen=True, eq=False)
class JointPrimitive:
    """A motion of J joints, transformation systems with a common phase.

    Attributes:
        names: J joint names, as in NAOqi.
        transformation: The transformation system of the joints.
        duration: Of the demonstration [s].
        approximator: The approximator's name.
        name: Of the demonstration.
    """

    names: tuple[str, ...]
    transformation: TransformationModel
    duration: float
    approximator: str = DEFAULT_APPROXIMATOR
    name: str = "primitive"

    __repr__ = short_repr

    @classmethod
    def fit(
        cls,
        times: npt.ArrayLike,
        joints: npt.ArrayLike,
        names: Sequence[str],
        *,
        approximator: str = DEFAULT_APPROXIMATOR,
        num_basis: int | None = None,
        scaling: str = DEFAULT_SCALING,
        alpha_z: float = ALPHA_Z,
        seed: int = 0,
        name: str = "primitive",
    ) -> Self:
        """Learns a motion of joints.

        Args:
            times: (N,) [s], increasing.
            joints: (N, J) [rad].
            names: J names.
            approximator: How the forcing term is learned; see `approximator_names`.
            num_basis: Number of basis functions. Left out, it follows the data: 40, at most the
                number of samples, doubled while the motion deviates from the demonstration by more
                than `FIT_TOLERANCE`.
            scaling: How the motion adapts to start and goal; see `scaling`.
            alpha_z: Constant of the spring.
            seed: For approximators with random starts.
            name: For messages.

        Raises:
            InputError: Shapes disagree, times do not increase, or a value is not finite.
        """
        try:
            t, q = np.array(times, dtype=float), np.array(joints, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{name}: times and joints are not arrays of numbers") from None
        if t.ndim != 1 or len(t) < _FEWEST or q.shape != (len(t), len(names)) or not len(names):
            raise InputError(
                f"{name}: times {t.shape} and joints {q.shape} must be (N,) and (N, J), N >= 4,"
                f" with J names ({len(names)} given)"
            )
        if not (np.isfinite(t).all() and np.isfinite(q).all()):
            raise InputError(f"{name}: a time or a joint is not finite; remove that sample")
        if np.any(np.diff(t) <= 0.0):
            raise InputError(f"{name}: times must increase from sample to sample")
        get_approximator(approximator)
        duration = float(t[-1] - t[0])
        v, a, _ = interpolant(t, q)
        kept = evenly_chosen(len(t), MOST_SAMPLES)
        t, q, v, a = t[kept], q[kept], v[kept], a[kept]
        curve = hermite(t, q, v)
        if strays(t, q, curve):
            curve = careful(t, q)

        def learn(number: int) -> TransformationModel:
            shown, joints, rates, curvatures = t, q, v, a
            filled = fill_times(t, longest_step(t, number))
            if len(filled) > len(t):
                shown, joints = filled, curve(filled)
                rates, curvatures = curve.derivative(1)(filled), curve.derivative(2)(filled)
            sample = MotionSample(
                (shown - t[0]) / duration, joints, rates * duration, curvatures * duration**2
            )
            return learn_attractor([sample], approximator, number, scaling, alpha_z, seed)

        def deviation(model: TransformationModel) -> float:
            shown = fill_times(t, duration / COMPARED)
            path = cls(tuple(names), model, duration).rollout(duration / COMPARED)
            own = hermite(path.times, path.joints, path.velocities)(shown - t[0])
            return float(np.abs(own - curve(shown)).max())

        if num_basis is None:
            model = choose_num_basis(len(t), learn, deviation, FIT_TOLERANCE)
        else:
            model = learn(num_basis)
        return cls(tuple(names), model, duration, approximator, name)

    @classmethod
    def of(cls, demonstration: Demonstration, **options: object) -> Self:
        """Learns the joints of a demonstration; options as in `fit`.

        Raises:
            InputError: It has no joints.
        """
        if demonstration.joints is None:
            raise InputError(f"{demonstration.name}: no joints in it; record them, too")
        return cls.fit(
            demonstration.times,
            demonstration.joints,
            demonstration.joint_names,
            name=demonstration.name,
            **options,  # type: ignore[arg-type]
        )

    @property
    def start(self) -> Array:
        """(J,) the demonstration's first joints [rad]."""
        return self.transformation.frame.start

    @property
    def goal(self) -> Array:
        """(J,) the demonstration's last joints [rad]."""
        return self.transformation.frame.goal

    def rollout(
        self,
        time_step: float = 0.01,
        start: npt.ArrayLike | None = None,
        goal: npt.ArrayLike | None = None,
        duration: float | None = None,
        start_velocity: npt.ArrayLike | None = None,
    ) -> JointPath:
        """Performs the motion.

        Args:
            time_step: [s].
            start: (J,) [rad]; the demonstration's if left out.
            goal: (J,) [rad]; the demonstration's if left out.
            duration: [s]; the demonstration's if left out.
            start_velocity: (J,) [rad/s]; the demonstration's if left out.

        Raises:
            InputError: A value is not finite, not positive where it must be, or of another shape.
        """
        tau = self.duration if duration is None else float(duration)
        check_seconds(duration=tau, time_step=time_step)
        size = len(self.names)
        q0 = vector(start, self.start, size, "start")
        g = vector(goal, self.goal, size, "goal")
        v0 = vector(
            start_velocity,
            self.transformation.start_velocity(q0, g, tau),
            size,
            "start_velocity",
        )
        steps = number_of_steps(tau, time_step)
        motion = undisturbed_motion(self.transformation, q0, g, v0, tau, time_step, steps)
        return JointPath(
            motion.times, motion.positions, motion.velocities, motion.accelerations, motion.phases
        )

    def hand_demonstration(
        self, others: Mapping[str, float] | None = None, time_step: float = 0.01
    ) -> Demonstration:
        """Returns the motion of the hand, by forward kinematics, with the arm's five joints.

        Args:
            others: Positions [rad] of the arm's other joints, which are held.
            time_step: [s].

        Raises:
            InputError: The joints are not of one arm, or one is neither moved nor given.
        """
        path = self.rollout(time_step)
        held = dict(others or {})
        for arm in ARMS:
            chain = arm_chain(arm)
            if set(self.names) <= set(chain.joint_names):
                missing = [n for n in chain.joint_names if n not in self.names and n not in held]
                if missing:
                    raise InputError(
                        f"{self.name}: where is {missing[0]} while the others move? give it"
                    )
                columns = [
                    path.joints[:, self.names.index(n)]
                    if n in self.names
                    else np.full(len(path.times), held[n])
                    for n in chain.joint_names
                ]
                joints = np.column_stack(columns)
                positions, rotations = chain.hand(joints)
                return Demonstration.from_positions(
                    path.times,
                    positions,
                    rotations=rotations,
                    joints=joints,
                    joint_names=chain.joint_names,
                    name=self.name,
                )
        raise InputError(f"{self.name}: {', '.join(self.names)} are not joints of one arm")

    def hand_primitive(self, others: Mapping[str, float] | None = None) -> MovementPrimitive:
        """Returns a primitive of the hand with this motion as its posture, for the controller."""
        return MovementPrimitive.fit(self.hand_demonstration(others))

    def save(self, path: str | Path) -> None:
        """Writes the primitive as one readable YAML file, exact to the last bit."""
        from pepper_drake.learning.dmp.primitive_files import (
            VERSION,
            transformation_data,
            yaml_lines,
        )

        data = {
            "version": VERSION,
            "name": self.name,
            "approximator": self.approximator,
            "duration": self.duration,
            "joints": list(self.names),
            "transformation": transformation_data(self.transformation),
        }
        header = "# A joint-space primitive of pepper_drake. Units: s, rad.\n"
        write_atomically(Path(path), header + "".join(yaml_lines(data)))

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Reads a primitive.

        Raises:
            InputError: With file, field and what to do.
        """
        from pepper_drake.learning.dmp.primitive_check import check_joint_movement
        from pepper_drake.learning.dmp.primitive_files import (
            VERSION,
            read_fields,
            read_transformation,
        )

        file = Path(path)
        fields = read_fields(file)
        version = fields.value("version", int)
        if version != VERSION:
            raise InputError(
                f"{file}: version {version} is not known; this program reads {VERSION}"
            )
        names = fields.value("joints", list)
        if not names or not all(isinstance(name, str) for name in names):
            raise InputError(f"{file}: joints must be a list of names")
        approximator = fields.name_of("approximator", get_approximator)
        model = read_transformation(fields.inner("transformation"), approximator, size=len(names))
        if model.model.num_dimensions != len(names):
            raise InputError(
                f"{file}: {len(names)} joints, but the forcing term has"
                f" {model.model.num_dimensions} dimensions"
            )
        primitive = cls(
            tuple(names),
            model,
            fields.positive("duration"),
            approximator,
            str(fields.value("name", str)),
        )
        check_joint_movement(primitive, file)
        return primitive
