"""Measures a planner's computing time for reports; no plan depends on it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import thread_time
from typing import NamedTuple, TypeVar

from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.planner_wrapper import PlannerWrapper

T = TypeVar("T")


class PlanningTime(NamedTuple):
    """Computing time of one call.

    Attributes:
        name: Name of the planner's method.
        time: Simulation time of the observation [s].
        seconds: Processor time of the calling thread [s].
    """

    name: str
    time: float
    seconds: float


@dataclass(frozen=True)
class TimedPlanner(PlannerWrapper):
    """Forwards all requests to a `Planner` and logs their computing time.

    Attributes:
        log: Computing times in the order of the calls, of all simulations that use this planner.
    """

    log: list[PlanningTime] = field(default_factory=list)

    def seconds(self, first: float, last: float) -> float:
        """Returns the computing time for observations between two times [s]."""
        return sum(one.seconds for one in self.log if first <= one.time <= last)

    def _answer(self, name: str, observation: Observation, ask: Callable[[Observation], T]) -> T:
        begin = thread_time()
        answer = ask(observation)
        self.log.append(PlanningTime(name, observation.time, thread_time() - begin))
        return answer
