"""Parameters of the gaze: following an object, searching for it, scanning around it."""

import math
from dataclasses import dataclass, field

from pepper_drake.errors import InputError


@dataclass
class HeadSearchParams:
    """Views of the head in search of an object."""

    low_pitch: float = 0.3
    """Pitch at which tables are searched [rad]."""
    lost_pitch: float = 0.5
    """The same for an object that was seen before [rad]: it was near, and the images of the top and
    the bottom camera do not overlap there."""
    high_pitch: float = -0.1
    """Pitch at which higher places are searched [rad]."""
    first_yaw: float = 0.4
    """Yaw to the arm's side at the start of the search [rad]: the field of view then covers the
    space ahead and within reach."""
    first_duration: float = 1.5
    """Dwell time there [s]."""
    sweep: float = math.radians(60)
    """Largest yaw to either side [rad]: four views this far apart overlap by a third."""
    view_duration: float = 1.4
    """Duration of each of the eight views [s], of which the head moves for 0.6 s: three images at
    5 Hz must agree."""
    view_images: float = 4.0
    """Number of images for which a view waits where they come more seldom: three that agree, and
    one while the head moves."""


@dataclass(unsafe_hash=True)
class ViewParams:
    """Weights of the view points around an object in view planning."""

    largest_age: float = 4.0
    """Age beyond which the urgency of a view point stays constant [s]."""
    movable_radius: float = 0.12
    """Distance to a movable object within which a view point has full weight [m]."""
    empty_weight: float = 0.25
    """Relative weight of view points without a movable object nearby."""
    hand_ahead: float = -0.1
    """Point from which the hand approaches, ahead of the object [m] ..."""
    hand_left: float = 0.3
    """... and to its left, for a left arm [m]."""
    hand_distance: float = 0.15
    """Distance to the hand's path at which the weight is one half [m]."""


@dataclass
class GazeParams:
    """Timing and limits of the head that follows an object and scans around it."""

    max_velocity: float = 2.5
    """Largest velocity of a head joint [rad/s], a third of the rated one; limits motion blur."""
    max_acceleration: float = 8.0
    """Largest acceleration of a head joint [rad/s²]."""
    missed_age: float = 1.9
    """Age of the last sighting at which the object counts as missed [s]."""
    missed_age_moving: float = 0.6
    """The same for a moving object, which leaves the image soon [s]: one image has missed it. All
    cameras look for it."""
    lead_time: float = 1.0
    """Longest time since the last sighting for which a moving object is thought to have kept its
    velocity [s]; after it, it is searched for along its motion."""
    turn_speed: float = 0.05
    """Speed of the head that follows it below which an object moves along the line of sight
    [rad/s]."""
    centering_age: float = 1.6
    """Age of the last sighting at which a scan ends and the object is centred [s]."""
    scan_age: float = 0.35
    """Age of the last sighting up to which the object may leave the image [s]; images are a quarter
    of a second old. Where they come later, it may once one that was taken since the last glance
    has come."""
    rest_speed: float = 0.02
    """Speed below which an object is at rest, and may leave the image [m/s]."""
    following_angle: float = 0.03
    """Dead band of following an object's centre [rad]: larger than the joints' backlash, which
    would otherwise cause a limit cycle, as the image moves by it whenever the head reverses."""
    glance_angles: list[float] = field(
        default_factory=lambda: [-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75]
    )
    """Angles beside the object to which the head may glance [rad]."""
    dwell: float = 0.2
    """Duration of a glance [s]: one period of the cameras."""
    dwell_angle: float = 0.05
    """Angle to its target below which the head dwells [rad] ..."""
    dwell_speed: float = 0.6
    """... and the joint velocity below which it does [rad/s]."""
    movable_height: float = 0.03
    """Height above the object's origin from which points count as movable objects [m]."""
    movable_distance: float = 0.8
    """Distance from the object within which they do [m]."""
    place_grid: float = 0.02
    """Grid to which the object's position is rounded for gazes shared by two cameras [m]."""
    largest_offset: float = 0.95
    """Largest offset of the object from the centre of its camera's image, 1 at the border, when the
    head turns for the other camera."""
    view_margin: float = 0.012
    """Displacement of the object during a scan that keeps it within the image [m]."""
    swing: float = 0.4
    """Amplitude of the search for a missed object [rad]."""
    swing_period: float = 2.4
    """Period of that search [s]."""
    search: HeadSearchParams = field(default_factory=HeadSearchParams)
    """Search for an object that was not seen yet."""
    view: ViewParams = field(default_factory=ViewParams)
    """Weights of the view points around the object."""

    def check(self) -> None:
        """Raises InputError for values with which the head could not move or aim."""
        positive = {
            "max_velocity": self.max_velocity,
            "max_acceleration": self.max_acceleration,
            "place_grid": self.place_grid,
            "swing_period": self.swing_period,
            "search.sweep": self.search.sweep,
            "search.view_duration": self.search.view_duration,
            "search.view_images": self.search.view_images,
            "view.hand_distance": self.view.hand_distance,
        }
        for name, value in positive.items():
            if not value > 0.0:
                raise InputError(f"gaze.{name} is {value:g}; it must be positive")
        if not self.glance_angles:
            raise InputError("gaze.glance_angles is empty; give one angle at least")
        if not abs(self.search.first_yaw) <= self.search.sweep:
            raise InputError(
                f"gaze.search.first_yaw is {self.search.first_yaw:g} rad; it must lie within "
                f"gaze.search.sweep, {self.search.sweep:g} rad"
            )
