"""A reach planned with perfect knowledge and performed without dynamics, measured like the others.

The base poses are those of our own planner with perfect knowledge, tried one after the other. Each
plan is checked against the true shapes at 100 Hz, as the arm would move. A plan in collision is not
performed, and the search continues.

The time to first motion is the planner's processor time at the base pose where it found the path:
goal postures, planning, smoothing and timing. It does not include the model of the scene, base
poses tried before, and the check.

If an obstacle moves, the planner knows its path: it plans with the obstacle at its start, and with
the obstacle at its end, and lets the arm wait as long as needed, up to the obstacle's end. A scene
without such a plan may still have a solution, but counts as solvable only if another method solves
it.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.goal_search import goal_postures
from pepper_drake.benchmarking.known_scene import GroundTruthScene
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.metrics import demonstration_distance, path_length, rms_jerk
from pepper_drake.benchmarking.ompl_rrt_connect import rrt_connect, seed_ompl
from pepper_drake.benchmarking.pink_barriers import barrier_motion
from pepper_drake.benchmarking.planned_reach_page import record_motion
from pepper_drake.benchmarking.roboplan_rrt import roboplan_rrt
from pepper_drake.benchmarking.timed_path import timed_path
from pepper_drake.benchmarking.trajectory_optimization import optimized_motion
from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.results.reach_report import pose_error

Array = npt.NDArray[np.float64]

_STEP = 0.01
_WAITING_STEP = 0.25
"""Step between waiting times that are tried [s]."""
_PADDINGS = (0.010, 0.003)
"""Paddings between the arm and the scene, in the order of trying [m]."""
_LONGEST_SEARCH = 60.0
"""Computing time, for each padding, after which no further base pose is tried [s]."""
_HOLDING = 1.0
"""Minimum time that the hand stays at its goal [s]."""

Motions = Callable[[GroundTruthScene, Array, int], Iterator[Array]]
"""Yields motions (N, 5) [rad], sampled every 10 ms, for a scene, a base pose (3,) and a seed."""


class _Found(NamedTuple):
    """Motion (N, 5), waiting time before it [s], base pose, and planning time [s]."""

    motion: Array
    waiting: float
    base_pose: Array
    seconds: float


def rrt_motions(known: GroundTruthScene, base_pose: Array, seed: int) -> Iterator[Array]:
    """Yields one motion by RRT-Connect to the goal posture that it reaches first."""
    seed_ompl(seed)
    goals = goal_postures(known, base_pose, np.random.default_rng(seed))
    corners = rrt_connect(known, base_pose, goals) if goals else None
    motion = timed_path(known.scene.arm, corners) if corners is not None else None
    if motion is not None:
        yield motion


def roboplan_motions(known: GroundTruthScene, base_pose: Array, seed: int) -> Iterator[Array]:
    """Yields one motion by RoboPlan to the first goal posture with a path."""
    goals = goal_postures(known, base_pose, np.random.default_rng(seed))
    corners = roboplan_rrt(known, base_pose, goals, seed=seed)
    motion = timed_path(known.scene.arm, corners) if corners is not None else None
    if motion is not None:
        yield motion


def barrier_motions(known: GroundTruthScene, base_pose: Array, seed: int) -> Iterator[Array]:
    """Yields the one motion of a reactive, deterministic policy."""
    yield barrier_motion(known, base_pose)


def optimized_motions(known: GroundTruthScene, base_pose: Array, seed: int) -> Iterator[Array]:
    """Yields one motion by trajectory optimisation to each goal posture."""
    for goal in goal_postures(known, base_pose, np.random.default_rng(seed)):
        yield optimized_motion(known, base_pose, goal)


@dataclass(frozen=True)
class PlannedReach:
    """A reach by a planner with perfect knowledge.

    Attributes:
        motions: The planner.
        prepare: Makes the planner's model of the scene; its time is not counted.
        reactive: Whether it is a reactive policy, which moves after the time of one step.
        options: None, as `reach.py` has no such method.
    """

    motions: Motions
    prepare: Callable[[GroundTruthScene], object] = lambda known: None
    reactive: bool = False
    options: None = None

    def __call__(self, case: Case) -> MethodResult:
        """Plans, checks and measures."""
        return self._run(case)[0]

    def replay(self, case: Case, folder: Path) -> MethodResult:
        """Plans again and writes `recording.html`, if a motion was found."""
        result, known, found = self._run(case)
        if found is not None:
            folder.mkdir(parents=True, exist_ok=True)
            page = record_motion(known, _whole(known, found.motion, found.waiting), found.base_pose)
            (folder / "recording.html").write_text(page)
            result.save(folder / "report.json")
        return result

    def _run(self, case: Case) -> tuple[MethodResult, GroundTruthScene, _Found | None]:
        begin = time.perf_counter()
        scene = case.build()
        for padding in _PADDINGS:
            known = GroundTruthScene(scene, padding=padding)
            found = self._search(known, case.seed)
            if found is not None:
                break
        result = MethodResult(planning_seconds=time.perf_counter() - begin)
        if found is None:
            result.outcome, result.reason = "refused", "no_clear_path"
            result.message = "no path was found from any place to stand"
        else:
            _measure(result, known, found)
        return result, known, found

    def _search(self, known: GroundTruthScene, seed: int) -> _Found | None:
        """Returns the first motion from any base pose that is free and ends at the goal."""
        self.prepare(known)
        stop_time, begin = known.quiet_after, time.process_time()
        for place in known.candidate_base_poses():
            if time.process_time() - begin > _LONGEST_SEARCH:
                break
            for moment in (0.0, stop_time) if stop_time else (0.0,):
                found = self._search_from(known, place, moment, seed)
                if found is not None:
                    return found
            known.set_time(0.0)
        return None

    def _search_from(
        self, known: GroundTruthScene, place: Array, moment: float, seed: int
    ) -> _Found | None:
        """Does the same from one base pose, planned with the obstacles as at a given time."""
        known.set_time(moment)
        begin = time.process_time()
        for motion in self.motions(known, place, seed):
            seconds = time.process_time() - begin
            counted = seconds / len(motion) if self.reactive else seconds
            is_at_goal = known.is_at_goal(motion[-1], place)
            for waiting in np.arange(0.0, known.quiet_after + _WAITING_STEP, _WAITING_STEP):
                clearance, _ = known.clearance(_whole(known, motion, waiting), place)
                if is_at_goal and clearance > 0.0:
                    return _Found(motion, float(waiting), place, counted)
            known.set_time(moment)
            begin = time.process_time() - seconds
        return None


def _whole(known: GroundTruthScene, motion: Array, waiting: float) -> Array:
    """Returns the whole motion: waiting, moving, and holding until all obstacles have stopped."""
    before = np.repeat(motion[:1], round(waiting / _STEP), axis=0)
    held = max(_HOLDING, known.quiet_after - waiting - len(motion) * _STEP)
    after = np.repeat(motion[-1:], round(held / _STEP), axis=0)
    return np.concatenate((before, motion, after))


def _measure(result: MethodResult, known: GroundTruthScene, found: _Found) -> None:
    """Fills in the result of a motion that reaches."""
    arm = known.scene.arm
    result.outcome = "reached"
    result.first_motion_seconds = found.seconds + found.waiting
    result.clearance, result.closest_pair = known.clearance(
        _whole(known, found.motion, found.waiting), found.base_pose
    )
    last = known.hand_poses(found.motion[-1:], found.base_pose)[0]
    result.position_error, result.orientation_error = pose_error(last, known.X_WG)
    moved = (len(found.motion) - 1) * _STEP
    result.duration = found.waiting + moved
    kinematics = arm_kinematics(shared_control_model(), arm)
    joints = _whole(known, found.motion, 0.0)
    hand = np.array([kinematics.hand_pose(q).translation() for q in joints])
    result.path_length = path_length(hand)
    result.jerk = rms_jerk(hand, _STEP)
    result.demonstration_distance = demonstration_distance(
        make_primitive(None, arm), hand, moved, _STEP
    )
