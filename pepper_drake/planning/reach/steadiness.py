"""Steadiness of the measurements while the arm reaches: a jumping signal ends the reach.

So does a cloud that differs from the map's. In a static scene a correct cloud may stay the same for
long, so only the comparison with the map reveals a stuck one. Before the arm starts, such a signal
ends nothing: it is the cause that is named when nothing can be planned with it. So is a head that
does not turn as it should.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.perception.mapping.depth_validity import FAULT_SENTENCES, DepthFault
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.safety.command_check import StopReason, stop_sentence

_SAMPLE = 300
"""Number of points of a cloud that are compared with the next cloud."""


@dataclass
class SteadinessParams:
    """Mean jumps from one observation to the next above which the reach ends."""

    outlier: float = 3.0
    """A single jump is clipped to this multiple of its limit: an object may be moved once."""
    memory: float = 1.0
    """Time constant of the means of goal, base and head [s]."""
    longest: float = 0.05
    """Longest time that a jump of goal or base counts for [s]: the supervision's period."""
    before_start: float = 0.2
    """Period of the means before the arm starts [s]: that of images. With each of them the
    supervision's state changes, which is work for the whole loop."""
    goal: float = 0.02
    """Mean jump of the goal object [m]: 0.4 m/s, which no reach could follow. Measured: 0.0001 at
    rest, 0.05 with noise of 20 mm."""
    base: float = 0.0015
    """Mean jump of the base, which should stand [m]. Measured: 0.0001, and 0.0026 with noise of
    0.1 m/s on its commands."""
    other_clouds: int = 3
    """Number of successive clouds that differ from the map's at the same image; normally 0."""
    cloud: float = 0.004
    """Mean jump of the cloud, a quantile of the distances from its points, as they were or moved on
    as before, to the next cloud [m]. Measured: 0.0001, and 0.009 with noise of 20 mm."""
    cloud_memory: float = 2.0
    """Time constant of the cloud's mean [s]: an obstacle may be carried away for so long."""
    cloud_quantile: float = 0.25
    """That quantile: an obstacle that moves may be most of a cloud, and not all of where it was is
    seen to be free at once."""
    head: float = 0.2
    """Mean deviation of a head joint from its command [rad]. Measured: 0.01, 0.04 on a worn robot,
    and 0.4 to 1 while its commands are stuck."""
    late: float = 0.6
    """Mean age of the newest image above which a camera's images come late or seldom [s]. Measured:
    0.3, and 1.2 where they come once a second."""
    oldest: float = 2.0
    """Age that counts for any greater one [s]."""
    moving: float = 0.1
    """Distance from a tracked obstacle up to which points may move with it [m]."""


@dataclass(frozen=True, eq=False)
class Steadiness:
    """Mean jumps of the signals from one observation to the next.

    Attributes:
        goal: Mean jump of the goal object [m].
        base: Mean jump of the base [m].
        cloud: Mean jump of the cloud [m].
        head: Mean deviations (2,) of HeadYaw and HeadPitch from their commands [rad].
        ages: Mean ages (2,) of the newest depth image in the cloud and of the newest colour image
            [s].
        shift: Motion (3,) of the cloud's centre from the cloud before to the previous one [m].
        other_clouds: Number of successive clouds that differ from the map's.
        last: The previous observation; None at the start.
        last_cloud: The observation with the previous cloud.
    """

    goal: float = 0.0
    base: float = 0.0
    cloud: float = 0.0
    head: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    ages: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    shift: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    other_clouds: int = 0
    last: Observation | None = None
    last_cloud: Observation | None = None

    def advanced(self, observation: Observation, params: SteadinessParams) -> "Steadiness":
        """Returns the means updated with an observation."""
        last, last_cloud = self.last, self.last_cloud
        updated = replace(self, last=observation)
        if last is not None:
            passed = observation.time - last.time
            weight = min(passed, params.longest) / params.memory
            share = min(passed / params.memory, 1.0)
            ages = np.array([observation.cloud_age, observation.image_ages.min()])
            goal = float(np.linalg.norm(observation.p_WO - last.p_WO))
            base = float(np.linalg.norm((observation.base_pose - last.base_pose)[:2]))
            updated = replace(
                updated,
                goal=_mean(self.goal, min(goal, params.outlier * params.goal), weight),
                base=_mean(self.base, min(base, params.outlier * params.base), weight),
                head=self.head + share * (np.abs(observation.head_error) - self.head),
                ages=self.ages + share * (np.minimum(ages, params.oldest) - self.ages),
            )
        if last_cloud is not None and observation.cloud_time == last_cloud.cloud_time:
            return updated
        other = 0 if observation.cloud_is_of_map else self.other_clouds + 1
        updated = replace(updated, last_cloud=observation, other_clouds=other)
        if last_cloud is None or not (len(last_cloud.cloud) and len(observation.cloud)):
            return updated
        before, tracked = last_cloud.cloud, observation.predicted_cloud
        updated = replace(updated, shift=observation.cloud.mean(axis=0) - before.mean(axis=0))
        sample = before[:: max(len(before) // _SAMPLE, 1)]
        if len(tracked):
            sample = sample[cKDTree(tracked).query(sample)[0] > params.moving]
        if not len(sample):
            return updated
        weight = (observation.time - last_cloud.time) / params.cloud_memory
        # What moves on as it did does not jump about: it may be all that there is.
        jump = min(
            float(np.quantile(observation.known.distance(points), params.cloud_quantile))
            for points in (sample, sample + self.shift)
        )
        return replace(
            updated,
            cloud=_mean(self.cloud, min(jump, params.outlier * params.cloud), weight),
        )

    def is_due(self, time: float, params: SteadinessParams) -> bool:
        """Tells whether the means are updated before the arm starts, at a time [s]."""
        return self.last is None or time - self.last.time > params.before_start - 1e-6

    def of_moving_base(self) -> "Steadiness":
        """Returns the means of a robot that may drive: its base is not held against it."""
        return replace(self, base=0.0)

    def unsteady_signal(self, params: SteadinessParams) -> tuple[str, str] | None:
        """Returns reason and sentence for a signal that is not steady; None if all are."""
        for name, jump, limit, words in (
            ("goal", self.goal, params.goal, "the goal object's estimated pose"),
            ("base", self.base, params.base, "the base, which should stand,"),
            ("cloud", self.cloud, params.cloud, "the cloud of obstacles"),
        ):
            if name == "cloud" and self.other_clouds >= params.other_clouds:  # It may jump, too.
                words = (
                    "the cloud of obstacles is not that of the map: it is stuck or comes changed"
                )
                return "cloud_wrong", words
            if jump > limit:
                return f"{name}_unsteady", f"{words} jumps about, by {1000 * jump:.1f} mm at a time"
        return None

    def cause(self, params: SteadinessParams) -> tuple[str, str] | None:
        """Returns reason and sentence of why nothing could be seen or planned; None if unknown."""
        joint = int(np.argmax(self.head))
        if self.head[joint] > params.head:
            held = StopReason.JOINT_HELD
            return held.name.lower(), stop_sentence(held, JOINT_GROUPS["head"][joint])
        return self.unsteady_signal(params)

    def late_images(self, depth: bool, params: SteadinessParams) -> tuple[str, str] | None:
        """Returns reason and sentence if images, of depth or colour, come late; None if not."""
        age = float(self.ages[0 if depth else 1])
        if age <= params.late:
            return None
        fault = DepthFault.NONE if self.last is None else self.last.cloud_fault
        if depth and fault not in (DepthFault.NONE, DepthFault.MISSING, DepthFault.LATE):
            return "cloud_missing", FAULT_SENTENCES[fault]
        reason, words = ("cloud", "depth camera's") if depth else ("images", "colour cameras'")
        return f"{reason}_missing", (
            f"the {words} images come so late or so seldom that the newest is {age:.1f} s old on "
            "average"
        )


def _mean(mean: float, jump: float, weight: float) -> float:
    """Returns a running mean updated with one jump."""
    return mean + min(weight, 1.0) * (jump - mean)
