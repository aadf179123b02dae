"""One command for all joints, of the parts that are commanded by different systems."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context

from pepper_drake.models.control_model import BODY_JOINTS, body_indices
from pepper_drake.systems.framework import LeafSystem


class JointCommandMerge(LeafSystem):
    """Merges the commands of joint groups; joints that no group commands stay where they are put.

    Its output depends on its inputs alone, not on time (as that of Drake's Multiplexer does), so
    that it is computed when a command changes and not at every step of the plant.

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
        groups: Joint names of each group, by its name.
        resting: Position of every joint by name [rad].
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
