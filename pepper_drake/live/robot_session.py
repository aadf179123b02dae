"""Teaching session on a robot: its limp arm is guided, and all demonstrations are learned."""

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
        recording: The recording.
        taught: The session's demonstrations including this one, and the movement learned from them.
    """

    recording: RobotRecording
    taught: Taught


def teach_robot(
    folder: SessionFolder, access: RobotAccess, options: RobotRecordOptions
) -> RobotLesson:
    """Records a demonstration on a robot, and learns a movement from all those of the session.

    The page of `apps/teach.py` can continue the session in the folder, and vice versa.

    Args:
        folder: Folder of the session, for the arm that is guided.
        access: Access to the robot.
        options: Options of the recording, with a folder of its own.

    Raises:
        LinkFault: As `record_robot`.
        StoppedError: As `record_robot`.
        InputError: A file of the session cannot be read or written, or the demonstration is not of
            the same movement as the others; then it is saved, but not used.
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
