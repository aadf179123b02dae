from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.robot_server.robot.tasks import TaskManager, TaskState


class Countdown:
    def __init__(self, cycles):
        self.cycles = cycles
        self.log = []

    def start(self):
        self.log.append("start")

    def step(self):
        self.cycles -= 1
        return self.cycles <= 0

    def stop(self):
        self.log.append("stop")


def test_a_task_whose_joint_is_booked_waits_and_then_starts():
    tasks = TaskManager()
    first = tasks.add("a", ["HeadYaw"], Countdown(3))
    second = tasks.add("b", ["HeadYaw", "HeadPitch"], Countdown(1))
    third = tasks.add("c", ["HeadPitch"], Countdown(1))
    fourth = tasks.add("d", ["LHand"], Countdown(9))
    assert first.state is fourth.state is TaskState.RUNNING
    # The third could run, but the second came before and wants its joint, too.
    assert second.state is third.state is TaskState.POSTPONED
    for _ in range(3):
        tasks.step()
    assert first.state is TaskState.DONE
    assert second.state is TaskState.RUNNING
    tasks.step()
    assert third.state is TaskState.RUNNING


def test_kill_stops_a_running_task_and_drops_a_waiting_one():
    tasks = TaskManager()
    running, waiting = Countdown(9), Countdown(9)
    first = tasks.add("a", ["x"], running)
    second = tasks.add("b", ["x"], waiting)
    assert tasks.kill(second.id)
    assert waiting.log == []
    assert tasks.kill(first.id)
    assert running.log == ["start", "stop"]
    assert not tasks.kill(first.id)
    assert tasks.tasks() == []
    assert tasks.booked() == frozenset()


def test_who_waits_for_a_task_is_told_once():
    told = []
    tasks = TaskManager()
    task = tasks.add("a", ["x"], Countdown(1))
    task.when_ended(lambda: told.append(task.state))
    tasks.step()
    task.when_ended(lambda: told.append("later"))
    assert told == [TaskState.DONE, "later"]


_JOBS = st.lists(
    st.tuples(st.sets(st.sampled_from("abcd"), min_size=1), st.integers(1, 4)), max_size=12
)


@given(_JOBS, st.lists(st.integers(1, 12), max_size=4))
def test_no_joint_ever_has_two_masters_and_all_come_to_an_end(jobs, kills):
    tasks = TaskManager()
    every = [tasks.add("job", resources, Countdown(n)) for resources, n in jobs]
    for cycle in range(60):
        running = [task for task in tasks.tasks() if task.state is TaskState.RUNNING]
        booked = [name for task in running for name in task.resources]
        assert len(booked) == len(set(booked))
        if cycle < len(kills):
            tasks.kill(kills[cycle])
        tasks.step()
    assert all(task.ended for task in every)
    assert [task.id for task in every] == list(range(1, len(every) + 1))
