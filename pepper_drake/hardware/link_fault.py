"""Faults of the link to a robot: a word for programs, a sentence for people."""

from pepper_drake.errors import PepperDrakeError

LINK_FAULTS: dict[str, str] = {
    "robot_unreachable": "no robot answers at that address",
    "robot_refused": "the robot refused the connection: user, password or encryption",
    "service_missing": "the robot lacks a service that is needed",
    "wrong_robot": "what answers is not a Pepper",
    "robot_not_ready": "the robot is not ready to move",
    "link_slow": "the connection is too slow to lead an arm over it",
    "link_lost": "the connection to the robot ended",
    "link_frozen": "the robot does not answer any more",
    "call_failed": "the robot answered a call with an error",
    "robot_rebooted": "the robot was restarted",
    "camera_missing": "the robot does not give a camera's images",
    "camera_frozen": "a camera's images do not change any more",
    "camera_size": "a camera gives images of another size than asked",
    "clock_jump": "the robot's clock jumped",
    "arm_slowed": "the robot slows its arm near what it sees",
    "arm_stalled": "the arm does not follow its commands",
    "stiffness_lost": "the arm's motors went limp",
    "taken_over": "another program commands the arm",
    "dead_man": "the dead man's switch was let go",
    "planner_silent": "no command came in time",
    "loop_late": "this computer is too slow to command the robot in time",
    "state_stale": "the robot's measurements are too old to act upon",
    "state_frozen": "the robot's measurements do not change while it is commanded to move",
}
"""Sentences by word."""

HANDED_OVER = frozenset(
    {
        "dead_man",
        "planner_silent",
        "loop_late",
        "camera_missing",
        "camera_frozen",
        "camera_size",
    }
)
"""Faults after which the robot can still be driven: its arm is lowered and relaxed. After the
others it is held, since its position, or who moves it, is not known."""


class LinkFault(PepperDrakeError):
    """A fault of the link or of the robot.

    Attributes:
        word: One of `LINK_FAULTS`.
    """

    def __init__(self, word: str, detail: str = "") -> None:
        """Makes the message.

        Args:
            word: One of `LINK_FAULTS`.
            detail: Particulars, if known.
        """
        self.word = word
        super().__init__(f"{LINK_FAULTS[word]}{f': {detail}' if detail else ''}")
