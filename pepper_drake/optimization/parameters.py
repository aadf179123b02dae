"""The searched numbers of a primitive, as one vector in metres.

Weights of a forcing term differ in size by a factor of 10000: late ones act while the phase is
nearly zero. Here a parameter of one metre is a change of weights whose largest displacement of the
hand is one metre, so that one exploration rate suits all, as equation 3.2 requires.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

from pepper_drake.errors import InputError
from pepper_drake.learning.approximators.registry import LinearForcingModel
from pepper_drake.learning.dmp.posture import PostureProfile
from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.learning.dmp.rollout import response_matrix
from pepper_drake.learning.dmp.scaling import scaled, scaling_matrix, unscaled
from pepper_drake.learning.phase import gate, phase_at
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

RADIANS_PER_METRE = 2.5
"""Joint angle [rad] equivalent to one metre: it moves a hand at 0.4 m by that distance."""

_STEPS = 200
"""Steps of the time grid on which changes are computed."""


@dataclass(frozen=True, eq=False)
class MovementParameters:
    """The part of a primitive that is searched.

    A vector x has `size` numbers. The first 3 `rows`, as a matrix (rows, 3), are changes in x, y
    and z: one row for each of `directions`, then, if `end_state` is free, the displacement of the
    end. The others, as a matrix (P, J), are changes of the nominal joints.

    Attributes:
        primitive: Where the search starts: x = 0.
        directions: (K, M) columns: the change of weights for one metre.
        end_state: Whether the primitive's goal is searched, too.
        posture: (L, P) columns: the change of the nominal joints' weights; or None.
    """

    primitive: MovementPrimitive
    directions: Array
    end_state: bool = True
    posture: Array | None = None

    __repr__ = short_repr

    @property
    def rows(self) -> int:
        """Number of searched parameters per coordinate."""
        return self.directions.shape[1] + self.end_state

    @property
    def size(self) -> int:
        """Number of searched parameters."""
        profile = self.primitive.posture
        if self.posture is None or profile is None:
            return 3 * self.rows
        return 3 * self.rows + self.posture.shape[1] * len(profile.names)

    def weights_and_goals(self, samples: npt.ArrayLike) -> tuple[Array, Array]:
        """Returns weights (S, K, 3) and goals (S, 3) [m] of parameters (S, size).

        They are for rollouts of `primitive`; see `primitive_at` for a primitive with its own goal.

        Raises:
            InputError: The parameters have the wrong shape.
        """
        x = self._checked(samples)
        changes = x[:, : 3 * self.rows].reshape(len(x), self.rows, 3)
        number = self.directions.shape[1]
        weights = self.primitive.weights + self.directions @ changes[:, :number]
        goals = np.broadcast_to(self.primitive.goal, (len(x), 3))
        return weights, goals + changes[:, -1] if self.end_state else goals

    def primitive_at(self, parameters: npt.ArrayLike) -> MovementPrimitive:
        """Returns the primitive with these parameters (size,): with its own start and end."""
        weights, goals = self.weights_and_goals(np.asarray(parameters, dtype=float)[None])
        changed = self.primitive.with_weights(weights[0])
        profile = changed.posture
        if self.posture is not None and profile is not None:
            nominal = self.posture_weights(np.asarray(parameters, dtype=float)[None])[0]
            changed = replace(changed, posture=replace(profile, weights=nominal))
        return with_end(changed, goals[0]) if self.end_state else changed

    def posture_weights(self, samples: npt.ArrayLike) -> Array:
        """Returns the weights (S, L, J) of the nominal joints for parameters (S, size).

        Raises:
            InputError: The parameters have the wrong shape, or the primitive has no posture.
        """
        x = self._checked(samples)
        own = _posture_of(self.primitive).weights
        if self.posture is None:
            return np.broadcast_to(own, (len(x), *own.shape))
        changes = x[:, 3 * self.rows :].reshape(len(x), -1, own.shape[1])
        return own + self.posture @ changes

    def _checked(self, samples: npt.ArrayLike) -> Array:
        x = np.asarray(samples, dtype=float)
        if x.ndim != 2 or x.shape[1] != self.size:
            raise InputError(f"parameters: shape {x.shape}; give (S, {self.size})")
        return x

    def features(self, steps: int) -> Array:
        """Returns (steps, rows): what a change of one metre adds to the acceleration.

        It is the change of tau² y'' before the spring's response, at `steps` times from start to
        end: psi in the policy of equation D.4.
        """
        attractor = self.primitive.translation
        phases = phase_at(np.linspace(0.0, 1.0, steps), attractor.alpha_x)
        columns = [_linear_model(self.primitive).features(phases) @ self.directions]
        if self.end_state:
            pull = np.ones(steps)
            if attractor.scaling == "gradual":
                pull = pull - gate(phases, attractor.alpha_x)
            columns.append(0.25 * attractor.alpha_z**2 * pull[:, None])
        return np.concatenate(columns, axis=1)


def all_weights(primitive: MovementPrimitive, *, end_state: bool = True) -> MovementParameters:
    """Returns all weights of a primitive as parameters: the report's choice.

    Raises:
        InputError: The primitive's forcing term is not linear in weights.
    """
    response = _position_response(primitive)[:, : len(primitive.weights)]
    peaks = np.abs(response).max(axis=0)
    peaks = np.where(peaks > 0.0, peaks, 1.0)
    return MovementParameters(primitive, np.diag(1.0 / peaks), end_state)


def smooth_bumps(
    primitive: MovementPrimitive, count: int, *, end_state: bool = True, posture: bool = False
) -> MovementParameters:
    """Returns a few smooth changes of the path as parameters, which keep its start and end.

    Each is a cubic B-spline of time with a peak of one metre, approximated by weights in the least-
    squares sense. A search over few parameters needs fewer rollouts.

    Args:
        primitive: Where the search starts.
        count: Number of bumps.
        end_state: Whether the end is searched, too.
        posture: Whether the nominal joints are, too: as many bumps, and a ramp that changes their
            end.

    Raises:
        InputError: The count is not positive, the forcing term is not linear in weights, or there
            is no posture to search.
    """
    if count < 1:
        raise InputError(f"kernels: {count}; use at least 1")
    times = np.linspace(0.0, 1.0, _STEPS + 1)
    bumps = _bumps(times, count)
    response = _position_response(primitive)[:, : len(primitive.weights)]
    peaks = np.abs(response).max(axis=0)
    peaks = np.where(peaks > 0.0, peaks, 1.0)
    fitted = np.linalg.lstsq(response / peaks, bumps, rcond=1e-6)[0]
    nominal = _posture_directions(primitive, count, ramp=True) if posture else None
    return MovementParameters(primitive, fitted / peaks[:, None], end_state, nominal)


def joint_bumps(
    primitive: MovementPrimitive, count: int, *, end_state: bool = True
) -> MovementParameters:
    """Returns the nominal joints as parameters, for an arm led by them; see `smooth_bumps`.

    Args:
        primitive: Where the search starts.
        count: Number of bumps for each joint.
        end_state: Whether a ramp changes the joints' end, too.

    Raises:
        InputError: The count is not positive, or there is no posture to search.
    """
    if count < 1:
        raise InputError(f"kernels: {count}; use at least 1")
    nothing = np.zeros((len(primitive.weights), 0))
    nominal = _posture_directions(primitive, count, ramp=end_state)
    return MovementParameters(primitive, nothing, False, nominal)


def _posture_directions(primitive: MovementPrimitive, count: int, *, ramp: bool) -> Array:
    """Returns (L, count or count + 1): weights of bumps of the joints, the last a ramp."""
    times = np.linspace(0.0, 1.0, _STEPS + 1)
    wanted = RADIANS_PER_METRE * _bumps(times, count)
    if ramp:
        rising = times**3 * (10.0 - 15.0 * times + 6.0 * times**2)
        wanted = np.column_stack((wanted, RADIANS_PER_METRE * rising))
    basis = _posture_of(primitive).basis(times)
    return np.asarray(np.linalg.lstsq(basis, wanted, rcond=1e-6)[0], dtype=float)


def _bumps(times: Array, count: int) -> Array:
    """Returns cubic B-splines (N, count) of times from 0 to 1, at rest at ends, with peaks of 1."""
    spacing = 1.0 / (count + 3)
    knots = spacing * np.arange(5)
    splines = [BSpline.basis_element(knots + k * spacing, extrapolate=False) for k in range(count)]
    values = np.column_stack([np.nan_to_num(spline(times)) for spline in splines])
    return np.asarray(values / values.max(axis=0))


def with_end(primitive: MovementPrimitive, goal: Array) -> MovementPrimitive:
    """Returns a primitive with its own end at `goal` (3,).

    Its rollouts are those of `primitive` to `goal`: the effect of the scaling is absorbed in the
    weights.

    Raises:
        InputError: The primitive's forcing term is not linear in weights.
    """
    attractor, weights = primitive.translation, primitive.weights
    model = _linear_model(primitive)
    start, scaling = attractor.frame.start, attractor.scaling
    frame = replace(attractor.frame, goal=goal)
    offset = attractor.offset(start, goal)
    if offset is not None:
        weights = weights + np.outer(_gate_weights(primitive), offset)
    matrix = scaling_matrix(scaling, frame, start, goal)
    weights = scaled(weights, attractor.matrix(start, goal))
    if matrix is not None:
        weights = unscaled(weights, matrix, scaling)
    moved = replace(
        attractor,
        frame=frame,
        model=model.with_weights(weights),
        start_rate=attractor.start_velocity(start, goal, 1.0),
    )
    return replace(primitive, translation=moved)


def _posture_of(primitive: MovementPrimitive) -> PostureProfile:
    if primitive.posture is None:
        raise InputError(
            f"{primitive.name}: it has no joints; learn it from a demonstration with joints"
        )
    return primitive.posture


def _linear_model(primitive: MovementPrimitive) -> LinearForcingModel:
    _ = primitive.weights  # Raises InputError if there are none.
    model = primitive.translation.linear_model
    assert model is not None
    return model


def _position_response(primitive: MovementPrimitive) -> Array:
    """Returns (steps + 1, K + 3): the path that each weight causes; see `response_matrix`."""
    alpha_z = primitive.translation.alpha_z
    return response_matrix(_linear_model(primitive), _STEPS, 1.0 / _STEPS, alpha_z)[: _STEPS + 1]


def _gate_weights(primitive: MovementPrimitive) -> Array:
    """Returns weights (K,) that make the forcing term equal to its gate."""
    phases = phase_at(np.linspace(0.0, 1.0, _STEPS + 1), primitive.translation.alpha_x)
    features = _linear_model(primitive).features(phases)
    # Relative to the gate, which falls by a factor of thousands.
    size = gate(phases, primitive.translation.alpha_x)[:, None]
    return np.asarray(np.linalg.lstsq(features / size, np.ones(len(phases)))[0])
