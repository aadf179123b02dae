"""The true contact forces on Pepper, which a real robot cannot know."""

from collections.abc import Set

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import ContactResults
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem


class TouchMonitor(LeafSystem):
    """Measures the contact forces between Pepper's links, obstacles and the goal object.

    For reports only; nothing that drives the robot may be connected to it.

    .. pydrake_system::

        name: TouchMonitor
        input_ports:
        - contact_results
        output_ports:
        - force

    Input: `contact_results`, the plant's. Output: `force` (2) [N]: the sums of the magnitudes of
    the contact forces between robot and obstacles, and between robot and goal object. State: the
    same, every `time_step`.

    Args:
        robot: Indices of Pepper's bodies.
        goal: Indices of the goal object's bodies; all other bodies are obstacles.
        time_step: Period [s].
    """

    def __init__(
        self, *, robot: Set[BodyIndex], goal: Set[BodyIndex], time_step: float = 0.01
    ) -> None:
        super().__init__()
        self._robot = frozenset(int(body) for body in robot)
        self._goal = frozenset(int(body) for body in goal)
        self.contact_results_input: InputPort = self.DeclareAbstractInputPort(
            "contact_results", Value(ContactResults())
        )
        self._force = self.DeclareDiscreteState(2)
        self.DeclareStateOutputPort("force", self._force)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        results: ContactResults = self.contact_results_input.Eval(context)
        force = np.zeros(2)
        for number in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(number)
            bodies = {int(info.bodyA_index()), int(info.bodyB_index())}
            if len(bodies & self._robot) == 1:
                is_goal = not self._goal.isdisjoint(bodies)
                force[int(is_goal)] += float(np.linalg.norm(info.contact_force()))
        discrete_state.set_value(self._force, force)
