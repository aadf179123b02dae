"""A session of teaching on a robot: its limp arm is led, and all that was shown is learned."""

from dataclasses import dataclass, replace

from pepper_drake.errors import InputError
from pepper_drake.hardware.robot_recording import (
    RobotRecording,
    RobotRecordOptions,
    record_robot,
)
from pepper_drake.hardware.transport import RobotAccess
from pepper_drake.learning import MovementPrimitive
from pepper_drake.live.session_file import DEMONSTRATIONS, SessionFolder, Taught


@dataclass(frozen=True)
class RobotLesson:
    """Results of one demonstration on a robot.

    Attributes:
        recording: How it was recorded.
        taught: The session's demonstrations with it, and the movement learned from them.
    """

    recording: RobotRecording
    taught: Taught


def teach_robot(
    folder: SessionFolder, access: RobotAccess, options: RobotRecordOptions
) -> RobotLesson:
    """Records a demonstration on a robot, and learns one movement from all of the session.

    The folder is one that the page of `apps/teach.py` goes on with, and the other way round.

    Args:
        folder: The session's, of the arm that is led.
        access: Way to the robot.
        options: How it is recorded; in a folder of its own.

    Raises:
        LinkFault: As `record_robot`.
        StoppedError: As `record_robot`.
        InputError: A file of the session cannot be read or written, or what was shown is not the
            same movement as before; it is kept then, but does not count.
    """
    before = folder.taught(options.arm)
    recording = record_robot(access, options)
    motion = folder.named(recording.demonstration)
    shown = (*before.shown, motion)
    try:
        primitive = MovementPrimitive.fit(list(shown))
    except InputError as error:
        kept = folder.path / DEMONSTRATIONS / motion.name
        motion.save(kept)
        raise InputError(f"{error}; it is kept in {kept}, and does not count") from None
    folder.record.arm = options.arm
    taught = replace(before, shown=shown, primitive=primitive, learned=motion)
    folder.write(taught)
    return RobotLesson(recording, taught)
