"""Merges the commands of joint groups into one for all joints."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context

from pepper_drake.models.control_model import BODY_JOINTS, body_indices
from pepper_drake.systems.framework import LeafSystem


class JointCommandMerge(LeafSystem):
    """Merges the commands of joint groups; joints in no group are held at fixed positions.

    Unlike that of Drake's Multiplexer, its output depends on its inputs alone, not on time: it is
    computed when a command changes and not at every step of the plant.

    .. pydrake_system::

        name: JointCommandMerge
        input_ports:
        - (name of the first group)_command
        - ...
        output_ports:
        - joint_position_command

    Inputs: one for each group [rad]. Output: `joint_position_command` (15) [rad], in the order of
    `BODY_JOINTS`.

    Args:
        groups: Joint names by group name.
        resting: Fixed position of every joint by name [rad].
    """

    def __init__(self, groups: Mapping[str, Sequence[str]], resting: Mapping[str, float]) -> None:
        super().__init__()
        self._resting = np.array([resting[name] for name in BODY_JOINTS])
        self._inputs = [
            (self.DeclareVectorInputPort(f"{group}_command", len(names)), body_indices(names))
            for group, names in groups.items()
        ]
        self.DeclareVectorOutputPort(
            "joint_position_command",
            len(BODY_JOINTS),
            self._calc_command,
            prerequisites_of_calc={port.ticket() for port, _ in self._inputs}
            or {self.nothing_ticket()},
        )

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        command = self._resting.copy()
        for port, indices in self._inputs:
            command[indices] = port.Eval(context)
        output.SetFromVector(command)
