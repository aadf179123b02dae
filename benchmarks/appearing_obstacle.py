"""Outcomes of reaches in whose way a ball appears from one moment to the next.

    python benchmarks/appearing_obstacle.py --runs 100 --jobs 2

In each run a ball as wide as a fist appears at a random moment, at a random place of the hand's own
path, up to 1.2 s ahead of it. Classes of runs:

- measured: a depth image showed the ball so early that the arm could stop, after the image's age,
  the supervisor's period and its deceleration from the speed with which it came near
- near: the same, but the ball was nearer than the camera measures: it left a hole in the image
- unseen: no image showed it that early, so that no robot with this camera could avoid it

What the arm or other objects hide counts as shown, so the first two hold runs too hard, not too
easy. The speed is that of the robot's own part at the touch.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.cli_scenario import add_scenario_options, scenario_of
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.models.pepper import hand_frame
from pepper_drake.models.scene import Obstacle, Scene, load_scene
from pepper_drake.optimization.parallel import processes
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.scenario import NUMBERS, Scenario, build_reaching

Array = npt.NDArray[np.float64]

SCENES = ("table", "free", "clutter")
RADIUS = 0.04
"""Radius of the ball [m]."""
AHEAD = (0.1, 1.2)
"""Range of the time from its appearance until the hand would be there [s]."""
JUMP = 0.02
"""Duration of the appearance [s]."""
ABOVE = 1.5
"""Height above its place at which the ball waits, out of all views [m]."""
APART = 0.09
"""Least distance of the ball's centre to the hand frame and the goal object as it appears [m]."""
AFTER = 3.0
"""Time after the hand would have been there at which a run ends [s]."""
GENTLE = 0.05
"""Speed of a touch that is allowed [m/s]."""


@dataclass(frozen=True)
class Passage:
    """The undisturbed reach of a scene while the arm moves.

    Attributes:
        times: (N,) since the arm started [s].
        positions: Hand frame (N, 3) in W [m].
        cameras: (N,) poses of the depth camera in W.
    """

    times: Array
    positions: Array
    cameras: tuple[RigidTransform, ...]

    def at(self, time: float) -> Array:
        """Returns the hand's position (3,) at a time [s]."""
        return self.positions[int(np.argmin(np.abs(self.times - time)))]


@dataclass(frozen=True)
class Appearance:
    """When [s since the arm's start] and where [m, W] the ball appears, and the time ahead [s]."""

    scene: str
    time: float
    place: tuple[float, float, float]
    ahead: float


@dataclass(frozen=True)
class Outcome:
    """Result of one run: class, outcome and reason, speed at a touch [m/s] or None."""

    kind: str
    outcome: str
    reason: str | None
    touch_speed: float | None


def with_ball(scene: Scene, appearance: Appearance | None) -> Scene:
    """Returns the scene with the ball; it never appears if there is no appearance."""
    up = [0.0, 0.0, ABOVE]
    path, position = [[0.0, *up], [1.0, *up]], [0.5, 0.0, 1.0]
    if appearance is not None:
        position, at = list(appearance.place), max(appearance.time, 1e-3)
        path = [[0.0, *up], [at, *up], [at + JUMP, 0.0, 0.0, 0.0]]
    ball = Obstacle("appearing_ball", "sphere", [RADIUS], position=position, path=path)
    return replace(scene, obstacles=[*scene.obstacles, ball])


def simulation(
    scenario: Scenario, scene: str, appearance: Appearance | None, options: RunOptions
) -> ReachSimulation:
    """Returns the simulation of a reach in a shipped scene with the ball."""
    # With motion ports the ball's path begins when the arm starts.
    station = replace(scenario.station, obstacle_motion_ports=True)
    chosen = replace(scenario, scene=with_ball(load_scene(scene), appearance), station=station)
    return ReachSimulation(build_reaching(chosen), options)


def passage(scenario: Scenario, name: str) -> Passage:
    """Returns the reach of a shipped scene in which the ball does not appear."""
    reach = simulation(scenario, name, None, RunOptions(progress=False))
    log = reach.run().log
    moving = np.flatnonzero(log.mode == ReachMode.REACHING)
    plant = reach.reaching.station.plant
    context = plant.CreateDefaultContext()
    hand = plant.GetFrameByName(hand_frame(reach.reaching.scene.arm))
    positions, cameras = [], []
    for state in reach.states()[moving]:
        plant.SetPositionsAndVelocities(context, state)
        positions.append(hand.CalcPoseInWorld(context).translation())
        X_WHead = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("Head"))
        cameras.append(X_WHead @ CAMERA_DEPTH.X_HeadC)
    times = log.time_s[moving] - log.time_s[moving[0]]
    return Passage(times, np.array(positions), tuple(cameras))


def draw(rng: np.random.Generator, scenes: dict[str, Passage]) -> Appearance:
    """Draws a scene, a moment and a place of the hand's path some time ahead."""
    while True:
        name = str(rng.choice(list(scenes)))
        reach, ahead = scenes[name], float(rng.uniform(*AHEAD))
        time = float(rng.uniform(0.0, reach.times[-1] - ahead))
        place = reach.at(time + ahead)
        goal = np.array(load_scene(name).goal.position)
        beside_goal = np.linalg.norm((place - goal)[:2]) > APART
        if beside_goal and np.linalg.norm(place - reach.at(time)) > APART:
            return Appearance(name, time, (place[0], place[1], place[2]), ahead)


def kind_of(appearance: Appearance, reach: Passage, scenario: Scenario) -> str:
    """Returns the class of a run; see the module's documentation."""
    distances = np.linalg.norm(reach.positions - appearance.place, axis=1)
    contact = int(np.argmax((reach.times > appearance.time) & (distances < APART)))
    step = max(contact - 5, 0)
    speed = np.linalg.norm(reach.positions[contact] - reach.positions[step])
    speed /= reach.times[contact] - reach.times[step]
    separation, station = scenario.supervisor.separation, scenario.station
    needed = station.camera_latency + scenario.supervisor.time_step
    needed += speed / separation.deceleration
    latest = reach.times[contact] - needed
    usable = (reach.times > appearance.time + JUMP) & (reach.times < latest)
    p_CB = np.array([X.inverse() @ np.array(appearance.place) for X in reach.cameras])
    shown = usable & (p_CB[:, 2] > 0.0) & CAMERA_DEPTH.intrinsics.sees(p_CB)
    # Whenever the images are taken, one falls into a period of theirs.
    count = round(station.camera_period / (reach.times[1] - reach.times[0]))
    whole = np.convolve(shown, np.ones(count), "valid") >= count
    if not whole.any():
        return "unseen"
    begins = int(np.argmax(whole))
    measured = p_CB[begins : begins + count, 2].min() > CAMERA_DEPTH.intrinsics.near
    return "measured" if measured else "near"


def run(scenario: Scenario, appearance: Appearance, kind: str) -> Outcome:
    """Runs one reach in whose way the ball appears, until it was touched or avoided."""
    options = RunOptions(progress=False)
    reach = simulation(scenario, appearance.scene, appearance, options)
    supervisor = reach.reaching.supervisor

    def is_over() -> bool:
        root = reach.simulator.get_context()
        started = supervisor.progress(supervisor.GetMyContextFromRoot(root)).started
        return root.get_time() > started + appearance.time + appearance.ahead + AFTER

    options.should_stop = is_over
    report = reach.run().report
    return Outcome(kind, report.outcome, report.reason, report.own_touch_speed)


def summary(outcomes: Sequence[Outcome]) -> str:
    """Returns a table of the outcomes by class."""
    rows = ["class      runs  touched  above 50 mm/s  median mm/s  most mm/s"]
    for kind in ("measured", "near", "unseen"):
        chosen = [one for one in outcomes if one.kind == kind]
        speeds = 1e3 * np.array([o.touch_speed for o in chosen if o.touch_speed is not None])
        fast = int(np.count_nonzero(speeds > 1e3 * GENTLE))
        numbers = f"{np.median(speeds):11.0f}  {speeds.max():9.0f}" if len(speeds) else ""
        rows.append(f"{kind:9}  {len(chosen):4}  {len(speeds):7}  {fast:13}  {numbers}".rstrip())
    return "\n".join(rows)


def main() -> None:
    """Runs the reaches and prints a table and each touch."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    add_scenario_options(parser, NUMBERS)
    options = parser.parse_args()
    cli.quiet_libraries()
    scenario = scenario_of(options)
    rng = np.random.default_rng(options.seed)
    with processes(options.jobs) as pool:
        each = map if pool is None else pool.map
        scenes = dict(zip(SCENES, each(partial(passage, scenario), SCENES), strict=True))
        drawn = [draw(rng, scenes) for _ in range(options.runs)]
        kinds = [kind_of(one, scenes[one.scene], scenario) for one in drawn]
        runs = each(partial(run, scenario), drawn, kinds)
        outcomes = list(tqdm(runs, total=len(drawn)))
    for one, outcome in zip(drawn, outcomes, strict=True):
        if outcome.touch_speed is not None:
            print(f"{one.scene} {one.time:.2f} s, {one.ahead:.2f} s ahead: {outcome}")
    print(f"reach lasts {', '.join(f'{k} {v.times[-1]:.1f} s' for k, v in scenes.items())}")
    print(summary(outcomes))


if __name__ == "__main__":
    main()
