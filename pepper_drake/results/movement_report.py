"""The taught movement as it was performed: as shown, bent by the coupling, or adapted."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_mode import ReachMode, last_attempt
from pepper_drake.results.reach_log import ReachLog

Vector = npt.NDArray[np.float64]

AS_SHOWN, BENT, ADAPTED = "as_shown", "bent", "adapted"

_NEGLIGIBLE_COUPLING = 1e-3
"""A coupling term below this counts as zero [m/s²]."""


@dataclass
class MovementReport:
    """The taught movement as it was performed. Distances in m, times in s."""

    kind: str = ""
    """"as_shown", "bent" (by the coupling alone), "adapted" (to the perceived obstacles, before or
    during the movement); empty if the arm did not start."""
    taught_message: str = ""
    """The reason for not performing it as taught, as a sentence; empty if it was."""
    taught_clearance: float | None = None
    """Smallest clearance to perceived obstacles that the taught movement would have had."""
    taught_closest_pair: str = ""
    """Link and obstacle that would have come closest in it, by the true geometry."""
    mean_deviation: float | None = None
    """Mean distance of the performed path's points to the nearest point of the taught path, which
    has the same start and goal; of the last path, if the robot drove elsewhere."""
    largest_deviation: float | None = None
    """The largest of these distances."""
    largest_coupling: float = 0.0
    """Largest acceleration by the coupling term, |C_t| / tau² [m/s²]."""
    coupled_seconds: float = 0.0
    """Time during which the coupling acted."""
    detours: int = 0
    """Number of times that the rest of the movement was replanned during it."""
    retreats: int = 0
    """Number of times that the arm retreated."""
    returns: int = 0
    """Number of times that it went back to its first posture, for the robot to drive elsewhere."""
    waited_seconds: float = 0.0
    """Time during which the arm braked or stood still before the goal."""
    withdrawn_seconds: float = 0.0
    """Time during which it retreated, or waited after a retreat."""

    def lines(self, *, coupled: bool = True) -> list[str]:
        """Returns lines for the terminal: the kind of movement, and the effect of the coupling.

        Args:
            coupled: Whether the run had a coupling.
        """
        if not self.kind:
            return []
        kinds = {
            AS_SHOWN: "performed as shown",
            BENT: "the taught one, bent by the coupling alone",
            ADAPTED: "adapted",
        }
        lines = [f"  movement          {kinds[self.kind]}"]
        if self.kind == ADAPTED and self.taught_message:
            lines[0] += f": as taught, {self.taught_message}"
            if self.taught_closest_pair:
                lines.append(f"                    (closest: {self.taught_closest_pair})")
        if self.mean_deviation is not None and self.largest_deviation is not None:
            lines.append(
                f"  from taught path  {1000 * self.mean_deviation:6.1f} mm on average,"
                f" {1000 * self.largest_deviation:.1f} mm at most"
            )
        if not coupled:
            lines.append("  coupling          none: it was left out")
        elif self.coupled_seconds > 0.0:
            lines.append(
                f"  coupling          {self.largest_coupling:6.2f} m/s² at most,"
                f" for {self.coupled_seconds:.1f} s"
            )
        else:
            lines.append("  coupling          zero: no obstacle was near enough to act")
        happened = [
            f"{count} {one if count == 1 else several}"
            for one, several, count in (
                ("detour", "detours", self.detours),
                ("retreat", "retreats", self.retreats),
                ("drive elsewhere", "drives elsewhere", self.returns),
            )
            if count
        ]
        happened += [
            f"{what} for {seconds:.1f} s"
            for what, seconds in (
                ("stood", self.waited_seconds),
                ("withdrawn", self.withdrawn_seconds),
            )
            if seconds > 0.0
        ]
        if happened:
            lines.append(f"  during the reach  {', '.join(happened)}")
        return lines


def is_moving(log: ReachLog) -> npt.NDArray[np.bool_]:
    """Returns the rows (N,) in which the arm reaches, or holds its hand at the goal."""
    return np.isin(log.mode, (ReachMode.REACHING, ReachMode.HOLDING))


def coupling_strength(log: ReachLog) -> Vector:
    """Returns |C_t| / tau² (N,) [m/s²]."""
    return np.asarray(np.linalg.norm(log.coupling_m_per_s2, axis=1))


def deviations(path: Vector, taught: Vector) -> Vector:
    """Returns distances (N,) of the points of a path (N, 3) to the nearest of another (M, 3)."""
    # For a few hundred points this is faster than importing a k-d tree.
    return np.linalg.norm(path[:, None] - taught, axis=2).min(axis=1)


def measure_movement(log: ReachLog) -> MovementReport:
    """Returns a log's movement report, without the reason for adapting, which no log contains."""
    moving = is_moving(log)
    if not moving.any():
        return MovementReport()
    origin, reaching = log.movement_origin[moving], log.mode[moving] == ReachMode.REACHING
    step = float(np.median(np.diff(log.time_s)))
    strength = coupling_strength(log)[moving]
    acts = (strength > _NEGLIGIBLE_COUPLING) & (origin != Origin.NONE)
    off = deviations(log.hand_position_torso_m[last_attempt(log.mode)], log.taught_path_torso_m)
    replaced = np.isin(origin, (Origin.ADAPTED, Origin.DETOUR)).any()
    bent = BENT if acts.any() else AS_SHOWN
    return MovementReport(
        kind=ADAPTED if replaced else bent,
        mean_deviation=float(off.mean()),
        largest_deviation=float(off.max()),
        largest_coupling=float(strength.max()),
        coupled_seconds=step * float(np.count_nonzero(acts)),
        detours=_begins(origin, Origin.DETOUR),
        retreats=_begins(origin, Origin.RETREAT),
        returns=_begins(origin, Origin.RETURN),
        waited_seconds=step * float(np.count_nonzero((origin == Origin.NONE) & reaching)),
        withdrawn_seconds=step * float(np.count_nonzero(origin == Origin.RETREAT)),
    )


def _begins(origin: npt.NDArray[np.int64], kind: Origin) -> int:
    """Returns how often a movement of one origin began."""
    is_kind = np.concatenate(([False], origin == kind))
    return int(np.count_nonzero(np.diff(is_kind.astype(int)) > 0))
