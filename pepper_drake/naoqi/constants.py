"""Names and numbers of NAOqi on Pepper: joints, chains, frames, cameras, image formats.

From the maker's documentation of NAOqi 2.5 (chains, cameras, colour spaces, base limits).
"""

import math
from dataclasses import dataclass

HANDS = ("LHand", "RHand")
WHEELS = ("WheelFL", "WheelFR", "WheelB")

CHAINS: dict[str, tuple[str, ...]] = {
    "Head": ("HeadYaw", "HeadPitch"),
    "LArm": ("LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll", "LWristYaw", "LHand"),
    "Leg": ("HipRoll", "HipPitch", "KneePitch"),
    "RArm": ("RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll", "RWristYaw", "RHand"),
}
"""Joints of each chain, in NAOqi's order."""

JOINTS: tuple[str, ...] = tuple(joint for chain in CHAINS.values() for joint in chain)
"""The 17 joints that ALMotion positions: head, left arm with hand, leg, right arm with hand."""

BODY: tuple[str, ...] = JOINTS + WHEELS
"""`Body` in `getAngles` and `getBodyNames`: the joints, then the wheels (20)."""

GROUPS: dict[str, tuple[str, ...]] = {
    **CHAINS,
    "Body": BODY,
    "JointActuators": BODY,
    "Joints": tuple(joint for joint in JOINTS if joint not in HANDS),
    "Actuators": HANDS + WHEELS,
    "Arms": CHAINS["LArm"] + CHAINS["RArm"],
    "Legs": CHAINS["Leg"],
    "Wheels": WHEELS,
}
"""Joints of each group name in ALMotion."""

STIFFNESS_CHAINS: tuple[str, ...] = CHAINS["Head"] + CHAINS["LArm"] + CHAINS["RArm"]
"""Joints whose stiffness a program may set; the lower body follows `wakeUp` and `rest` only."""

FRAME_TORSO, FRAME_WORLD, FRAME_ROBOT = 0, 1, 2

CYCLE = 0.02
"""ALMotion's period [s]."""


@dataclass(frozen=True)
class BaseLimit:
    """A limit of the base, which a move's configuration may set.

    Attributes:
        default: Value unless set.
        lower: Least value that can be set.
        upper: Largest value that can be set.
    """

    default: float
    lower: float
    upper: float


BASE_LIMITS: dict[str, BaseLimit] = {
    "MaxVelXY": BaseLimit(0.35, 0.1, 0.55),
    "MaxVelTheta": BaseLimit(1.0, 0.2, 2.0),
    "MaxAccXY": BaseLimit(0.3, 0.1, 0.55),
    "MaxAccTheta": BaseLimit(0.75, 0.1, 3.0),
    "MaxJerkXY": BaseLimit(1.0, 0.2, 5.0),
    "MaxJerkTheta": BaseLimit(2.0, 0.2, 50.0),
}
"""Configuration keys of `move`, `moveTo`, `moveToward` [m/s, rad/s, m/s^2, rad/s^2, ...]."""

TOP, BOTTOM, DEPTH, STEREO = 0, 1, 2, 3
"""Camera ids."""


@dataclass(frozen=True)
class Camera:
    """A camera as described by ALVideoDevice.

    Attributes:
        name: NAOqi's name of the camera and its frame.
        model: Model id.
        width_fov: Horizontal field of view [rad].
        height_fov: Vertical field of view [rad].
        fps: Largest frame rate [1/s].
        resolutions: Resolution ids that it serves.
        color_spaces: Colour-space ids that it serves.
    """

    name: str
    model: int
    width_fov: float
    height_fov: float
    fps: int
    resolutions: tuple[int, ...]
    color_spaces: tuple[int, ...]


RESOLUTIONS: dict[int, tuple[int, int]] = {
    8: (40, 30),
    7: (80, 60),
    0: (160, 120),
    1: (320, 240),
    2: (640, 480),
    3: (1280, 960),
    4: (2560, 1920),
}
"""Width and height [pixels] by resolution id."""

QQVGA, QVGA, VGA, VGA4, VGA16, QQQVGA, QQQQVGA = 0, 1, 2, 3, 4, 7, 8

LAYERS: dict[int, int] = {
    0: 1,  # Y; of the depth camera a grey image of the distance.
    1: 1,  # U
    2: 1,  # V
    3: 1,  # R
    4: 1,  # G
    5: 1,  # B
    6: 1,  # H
    7: 1,  # S
    8: 1,  # Y of HSY
    9: 2,  # YUV 4:2:2
    10: 3,  # YUV
    11: 3,  # RGB; of the depth camera false colour.
    12: 3,  # HSY
    13: 3,  # BGR
    14: 2,  # YYCbCr, two pixels in four bytes
    15: 3,  # H as colour
    16: 3,  # H, S, (H + S) / 2
    17: 2,  # depth [mm], 16 bits
    19: 12,  # x, y, z [m], 32-bit floats
    21: 2,  # distance [mm], 16 bits
    23: 2,  # depth as measured [mm], 16 bits
}
"""Bytes per pixel by colour-space id: the number of layers in a reply."""

YUV422, YUV, RGB, HSY, BGR, YYCBCR, H2RGB, HS_MIXED = 9, 10, 11, 12, 13, 14, 15, 16
DEPTH_MM, XYZ, DISTANCE, RAW_DEPTH = 17, 19, 21, 23

_COLORS = tuple(range(17))
_DEPTHS = (0, RGB, DEPTH_MM, XYZ, DISTANCE, RAW_DEPTH)

CAMERAS: dict[int, Camera] = {
    TOP: Camera(
        "CameraTop", 3, math.radians(56.3), math.radians(43.7), 30, (8, 7, 0, 1, 2, 3, 4), _COLORS
    ),
    BOTTOM: Camera(
        "CameraBottom", 3, math.radians(56.3), math.radians(43.7), 30, (8, 7, 0, 1, 2), _COLORS
    ),
    DEPTH: Camera("CameraDepth", 4, math.radians(58), math.radians(45), 20, (8, 7, 0, 1), _DEPTHS),
}
"""The cameras of a Pepper 1.8a, by id."""
