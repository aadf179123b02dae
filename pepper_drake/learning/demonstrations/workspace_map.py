"""The correspondence of a person's workspace and the robot's."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.demonstration import Demonstration

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class WorkspaceMap:
    """Maps the motion of something a person holds to the robot's hand.

    The motion is taken relative to its start, rotated into the robot's axes, scaled to the robot's
    arm, and applied from the pose of the robot's hand:
    the robot's arm, and set down where the robot's hand is:

        p_TH(t) = p_TH(0) + scale R (p_TM(t) - p_TM(0)),
        R_TH(t) = R (R_TM(t) R_TM(0)^-1) R^-1 R_TH(0),   R = Rz(yaw).

    Angles are not scaled. Neither the person's grip nor position matters. With yaw = pi, for a
    person facing the robot, the person's forward and right are the robot's.
    """

    scale: float = 0.6
    """Distance of the robot's hand per distance of the person's."""
    yaw: float = np.pi
    """From the person's axes to the robot's, about T's z axis [rad]."""

    def apply(self, shown: Demonstration, position: Array, rotation: Array) -> Demonstration:
        """Maps a motion.

        Args:
            shown: Motion of what the person holds, in T, with rotations.
            position: (3,) p_TH(0), where the robot's hand is [m].
            rotation: (4,) its orientation, unit quaternion w, x, y, z.

        Raises:
            InputError: The motion has no rotations.
        """
        if shown.rotations is None:
            raise InputError(f"{shown.name}: the motion has no orientation to map")
        turn = np.array([np.cos(self.yaw / 2), 0.0, 0.0, np.sin(self.yaw / 2)])
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        R = self.scale * np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        relative = so3.multiply(shown.rotations, so3.conjugate(shown.rotations[0]))
        rotations = so3.multiply(
            so3.multiply(so3.multiply(turn, relative), so3.conjugate(turn)), rotation
        )
        return Demonstration(
            times=shown.times,
            positions=position + (shown.positions - shown.positions[0]) @ R.T,
            velocities=shown.velocities @ R.T,
            accelerations=shown.accelerations @ R.T,
            rotations=so3.make_continuous(rotations),
            name=shown.name,
            derivation=shown.derivation,
        )


@dataclass(frozen=True)
class Sightings:
    """Poses of a marker, from images.

    Attributes:
        times: (N,) [s], increasing; of the images that show it.
        positions: (N, 3) p_TM [m].
        rotations: (N, 4) unit quaternions w, x, y, z of the marker in T.
    """

    times: Array
    positions: Array
    rotations: Array


def sighted_motion(
    sightings: Sightings,
    *,
    name: str = "marker",
    time_step: float = 0.01,
    cutoff: float = 2.0,
    longest_gap: float = 0.5,
) -> Demonstration:
    """Makes a motion from a marker's sightings: smoothed, at a constant time step.

    The smoothing spline (see `Demonstration.smoothed`) removes the noise of the images; a cubic
    spline interpolates between them.

    Args:
        sightings: At least five.
        name: For messages.
        time_step: [s].
        cutoff: Frequency at which smoothing halves the amplitude [Hz].
        longest_gap: Longest time without a sighting [s].

    Raises:
        InputError: There are too few sightings, or too long a gap.
    """
    t = sightings.times
    if len(t) < 5:
        raise InputError(f"{name}: the marker was seen in {len(t)} images; it takes at least 5")
    gaps = np.diff(t)
    worst = int(gaps.argmax())
    if gaps[worst] > longest_gap:
        raise InputError(
            f"{name}: the marker was not seen from {t[worst]:.1f} to {t[worst + 1]:.1f} s; keep it"
            " in the camera's view and turned to it"
        )
    smooth = Demonstration.from_positions(
        t, sightings.positions, rotations=sightings.rotations, name=name
    ).smoothed(cutoff)
    assert smooth.rotations is not None
    count = int(np.floor((t[-1] - t[0]) / time_step + 1e-6)) + 1
    times = np.arange(count, dtype=np.float64) * time_step
    spline = make_interp_spline(t - t[0], np.hstack((smooth.positions, smooth.rotations)), k=3)
    values = spline(times)
    return Demonstration(
        times=times,
        positions=values[:, :3],
        velocities=spline.derivative(1)(times)[:, :3],
        accelerations=spline.derivative(2)(times)[:, :3],
        rotations=so3.normalize(values[:, 3:]),
        name=name,
        derivation=smooth.derivation,
    )
