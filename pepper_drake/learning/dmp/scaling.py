"""Scaling of the forcing term to another start and goal, in five variants.

f = S h(x) + b x, with h the learned forcing term; the matrix S (D, D) and the vector b (D,) depend
on start y0 and goal g. b is zero for all but `gradual`.

- `gradual`: S = 1, b = -alpha_z beta_z ((g - y0) - (g_d - y0_d)). The change of start and goal
  takes effect as the phase falls, not all at once as a pull of the spring: the motion starts with
  the demonstrated acceleration (Pastor et al. 2009, doi:10.1109/ROBOT.2009.5152385; Hoffmann et
  al. 2009).
  The default: on 40 motions with goals moved by 8 to 20 cm and starts by 5 to 10 cm, the largest
  acceleration stayed that of the demonstration (median 1.0; `none` 1.8 to 4.3, `goal` 1.3 to 2.3
  and up to 400 where a coordinate's goal was near its start), and the acceleration does not jump at
  the start (`none`: 1.8 to 4.3 m/s²).
- `goal`: S = diag(g - y0), the report's equation 2.5. It explodes where the demonstration's goal
  was near its start in one coordinate, and mirrors the motion where g - y0 changes sign.
- `none`: S = 1. The deviation from the spring's unforced motion is kept as demonstrated.
- `amplitude`: S = diag(extent of the demonstration in each coordinate): the motions of `none`, with
  dimensionless weights.
- `rotation_dilation`: S = |g - y0| / |g_d - y0_d| R, R the smallest rotation from g_d - y0_d to
  g - y0: turns and grows with the motion (Koutras and Doulgeris 2020, a novel DMP formulation for
  global and frame independent spatial scaling, doi:10.1109/ICRA40945.2020.9196500).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]

SCALINGS = ("gradual", "none", "goal", "amplitude", "rotation_dilation")


@dataclass(frozen=True, eq=False)
class MotionFrame:
    """Reference of a scaling: a demonstration's start (D,), goal (D,) and extent (D,)."""

    start: Array
    goal: Array
    extent: Array


def check_scaling(name: str) -> None:
    """Raises InputError unless `name` is a scaling."""
    if name not in SCALINGS:
        raise InputError(f"scaling: '{name}' is unknown; use one of {', '.join(SCALINGS)}")


def scaling_matrix(name: str, frame: MotionFrame, start: Array, goal: Array) -> Array | None:
    """Returns S (D, D), or None for the identity; entries may be AutoDiffXd."""
    if name in ("none", "gradual"):
        return None
    if name == "goal":
        return np.diag(goal - start)
    if name == "amplitude":
        return np.diag(frame.extent)
    return _rotation_and_dilation(frame.goal - frame.start, goal - start)


def scaling_offset(
    name: str, frame: MotionFrame, start: Array, goal: Array, alpha_z: float
) -> Array | None:
    """Returns b (D,), or None for zero; entries may be AutoDiffXd."""
    if name != "gradual":
        return None
    return -0.25 * alpha_z**2 * ((goal - start) - (frame.goal - frame.start))


def scaled(values: Array, matrix: Array | None) -> Array:
    """Returns S applied to values (..., D)."""
    return values if matrix is None else values @ matrix.T


def unscaled(values: Array, matrix: Array | None, name: str) -> Array:
    """Returns the inverse of S applied to values (N, D), for learning.

    Coordinates without motion in which S is zero stay zero.

    Raises:
        InputError: S is singular and the motion cannot be expressed with it.
    """
    if matrix is None:
        return values
    singular = ~np.any(matrix != 0.0, axis=1)
    if np.abs(values[:, singular]).max(initial=0.0) > 1e-9:
        raise InputError(
            f"scaling: '{name}' cannot express a motion that ends where it starts; use 'none'"
        )
    return values @ np.linalg.inv(matrix + np.diag(singular.astype(float))).T


def _rotation_and_dilation(demonstrated: Array, wanted: Array) -> Array:
    size = np.sqrt(demonstrated @ demonstrated)
    length = np.sqrt(wanted @ wanted)
    identity = np.eye(len(wanted))
    if size == 0.0 or length == 0.0:
        return length * identity if size == 0.0 else 0.0 * identity
    a, b = demonstrated / size, wanted / length
    cosine = a @ b
    if cosine < -1.0 + 1e-12:
        # Half a turn about any perpendicular axis: the one nearest to the last coordinate's.
        axis = identity[-1] - a[-1] * a
        if axis @ axis < 1e-6:
            axis = identity[0] - a[0] * a
        axis = axis / np.sqrt(axis @ axis)
        rotation = 2.0 * np.outer(axis, axis) - identity
    else:
        # Half turns about a, then about the bisector: exact to rounding up to half a turn.
        middle = (a + b) / np.sqrt((a + b) @ (a + b))
        rotation = (2.0 * np.outer(middle, middle) - identity) @ (2.0 * np.outer(a, a) - identity)
    return length / size * rotation
