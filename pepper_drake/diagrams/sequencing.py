"""The sequence of tasks after the reach."""

from typing import TYPE_CHECKING

from pydrake.systems.framework import DiagramBuilder

from pepper_drake.systems.framework import connect
from pepper_drake.systems.task_sequencer import TaskSequencer

if TYPE_CHECKING:
    from pepper_drake.diagrams.reaching import Reaching


def add_sequencer(builder: DiagramBuilder, reaching: "Reaching") -> TaskSequencer:
    """Adds and returns the system that gives the supervisor the next of `config.tasks`."""
    config, supervisor = reaching.config, reaching.supervisor
    sequencer = builder.AddNamedSystem(
        "sequencer",
        TaskSequencer(
            reaching.planner.demonstrated,
            config.tasks,
            config.timing.time_step,
            reaching.scene.arm,
        ),
    )
    hand = {f"{reaching.scene.arm}_hand_pose": "hand_pose"}
    connect(builder, supervisor, sequencer, "mode")
    connect(builder, reaching.perception, sequencer, "object_pose")
    connect(builder, reaching.station, sequencer, "torso_pose", **hand)
    connect(builder, sequencer, supervisor, "command", "primitive")
    connect(builder, sequencer, reaching.station, "hand_command")
    return sequencer
