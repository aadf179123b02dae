import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from pepper_drake.models.pepper import head_pitch_limits
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_DEPTH, CAMERA_TOP
from pepper_drake.perception.gaze.gaze_params import GazeParams
from pepper_drake.perception.gaze.head_aiming import camera_pose, choose_camera, look_at
from pepper_drake.perception.mapping.cloud_points import make_cloud
from pepper_drake.systems.sensing.gaze_controller import GazeController

LIMITS = GazeParams()
SLOW = GazeParams(max_velocity=1.0, max_acceleration=4.0)
"""Slow enough that glances can be told apart."""
X_WT = RigidTransform([0.3, 0.1, 0.82])
FAR = RigidTransform([1.3, -0.3, 0.8])
NEAR = RigidTransform([0.62, -0.1, 0.72])
BEHIND = RigidTransform([-1.0, 0.0, 0.8])


class Bench:
    def __init__(self, object_pose, system=None, **inputs):
        self.system = system or GazeController()
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.fix("object_pose", object_pose)
        self.fix("X_WT", X_WT)
        for name, value in inputs.items():
            self.fix(name, value)

    def fix(self, name, value):
        self.system.GetInputPort(name).FixValue(self.context, value)

    def output(self, name):
        return np.array(self.system.GetOutputPort(name).Eval(self.context))

    def run(self, until):
        self.simulator.AdvanceTo(until)
        return self


def test_goal_ends_in_the_middle_of_the_image():
    bench = Bench(FAR).run(3.0)
    head = bench.output("head_position_command")
    p_CO = (X_WT @ camera_pose(CAMERA_TOP, head)).inverse() @ FAR.translation()
    np.testing.assert_allclose(p_CO[:2], 0, atol=1e-4)
    assert bench.output("in_view") == [1]
    assert bench.output("reachable") == [1]
    np.testing.assert_allclose(bench.output("head_velocity_command"), 0, atol=1e-6)


def test_camera_that_sees_best_is_the_one_that_is_on():
    bench = Bench(FAR).run(0.1)
    assert bench.output("best_camera") == [0]
    assert (bench.output("top_enabled"), bench.output("bottom_enabled")) == ([1], [0])
    bench.fix("object_pose", NEAR)
    bench.run(3.0)
    assert bench.output("best_camera") == [1]
    assert (bench.output("top_enabled"), bench.output("bottom_enabled")) == ([0], [1])
    head = bench.output("head_position_command")
    p_CO = (X_WT @ camera_pose(CAMERA_BOTTOM, head)).inverse() @ NEAR.translation()
    assert CAMERA_BOTTOM.intrinsics.sees(p_CO)


def test_head_moves_smoothly_and_within_its_limits():
    bench = Bench(RigidTransform([0.3, -2.0, 0.2]))
    last = np.zeros(2)
    last_velocity = np.zeros(2)
    for k in range(1, 120):
        bench.run(0.02 * (k - 1) + 0.001)
        head, velocity = (
            bench.output("head_position_command"),
            bench.output("head_velocity_command"),
        )
        np.testing.assert_allclose((head - last) / 0.02, velocity, atol=1e-9)
        assert np.all(np.abs(velocity) <= LIMITS.max_velocity + 1e-9)
        assert abs(velocity[0] - last_velocity[0]) <= LIMITS.max_acceleration * 0.02 + 1e-9
        lower, upper = head_pitch_limits(head[0])
        assert lower - 1e-12 <= head[1] <= upper + 1e-12
        last, last_velocity = head, velocity


def test_it_says_when_the_goal_is_out_of_reach():
    bench = Bench(BEHIND).run(4.0)
    assert bench.output("reachable") == [0]
    assert bench.output("in_view") == [0]


def test_goal_comes_into_view_while_the_head_turns():
    bench = Bench(RigidTransform([0.9, -1.0, 0.9])).run(0.01)
    assert (bench.output("in_view"), bench.output("reachable")) == ([0], [1])
    assert bench.run(2.0).output("in_view") == [1]


def test_head_starts_where_it_is_and_stays_without_a_goal():
    bench = Bench(FAR, head_position=[0.4, -0.2], valid=[0.0]).run(1.0)
    np.testing.assert_allclose(bench.output("head_position_command"), [0.4, -0.2])
    assert (bench.output("top_enabled"), bench.output("bottom_enabled")) == ([1], [1])
    assert bench.output("reachable") == [0]


def test_without_a_goal_the_head_searches_within_its_limits():
    system = GazeController(search=lambda time, side, was_seen: np.array([0.3, 2.0]))
    bench = Bench(FAR, system, valid=[0.0]).run(3.0)
    np.testing.assert_allclose(
        bench.output("head_position_command"), [0.3, head_pitch_limits(0.3)[1]], atol=1e-6
    )


@pytest.mark.parametrize(("age", "was_seen"), [(np.inf, False), (6.0, True)])
def test_the_search_knows_whether_the_object_was_seen_before(age, was_seen):
    asked = set()
    system = GazeController(
        search=lambda time, side, was_seen: asked.add(was_seen) or np.array([0.3, 0.2])
    )
    Bench(FAR, system, valid=[0.0], age=[age]).run(1.0)
    assert asked == {was_seen}


def searched_times(period, latency, until, last=np.inf):
    """Search times asked for at times (N,) [s].

    With images every `period`, `latency` old, none taken after `last` [s].
    """
    asked = []
    system = GazeController(
        search=lambda time, side, was_seen: asked.append(time) or np.array([0.3, 0.2])
    )
    bench = Bench(FAR, system, valid=[0.0])
    for k in range(round(until / 0.02)):
        now = 0.02 * k
        taken = 0.07 + period * np.floor((min(now - latency, last) - 0.07) / period + 1e-9)
        bench.fix("image_ages", [np.inf, now - taken if taken >= 0.0 else np.inf])
        bench.run(now + 0.001)
    waited = bench.output("search_delay")[0]
    assert waited == pytest.approx(0.02 * (len(asked) - 1) - asked[-1], abs=1e-6)
    return np.array(asked)


def test_the_search_waits_for_images_that_come_seldom():
    search = LIMITS.search
    usual = searched_times(0.2, 0.25, 8.0)
    np.testing.assert_allclose(np.diff(usual), 0.02, atol=1e-9)
    seldom = searched_times(1.0, 0.7, 20.0)
    assert (np.diff(seldom) > -1e-9).all()
    # As many images for each view as it needs, at least three of which the head stands still.
    for view in range(3):
        start = search.first_duration + view * search.view_duration
        within = (seldom >= start) & (seldom < start + search.view_duration)
        assert np.count_nonzero(within) * 0.02 == pytest.approx(search.view_images, abs=0.1)


def test_without_any_image_the_search_stays_in_its_first_view():
    first = LIMITS.search.first_duration
    assert searched_times(100.0, 99.0, 5.0).max() == pytest.approx(0.5 * first)


def test_a_search_waits_soon_after_its_images_end():
    search = LIMITS.search
    searched = searched_times(0.2, 0.25, 9.0, last=4.0)
    # The last was taken at 3.87 s.
    assert searched.max() == pytest.approx(3.87 + 0.25 + search.first_duration, abs=0.03)


def test_a_search_whose_images_come_again_goes_on_where_it_waited():
    search = LIMITS.search
    gap = searched_times(5.0, 0.2, 6.0)
    waiting = gap[round(4.0 / 0.02)]
    assert waiting == pytest.approx(0.5 * search.first_duration + search.view_duration / 4.0)
    assert 0.0 < gap[-1] - waiting <= search.view_duration / 4.0 + 1e-9


def test_each_search_begins_anew():
    system = GazeController(
        search=lambda time, side, was_seen: np.array([0.0 if time < 2.0 else 0.5, 0.0])
    )
    bench = Bench(FAR, system, valid=[1.0]).run(3.0)
    bench.fix("valid", [0.0])
    assert bench.run(4.9).output("head_position_command")[0] == pytest.approx(0.0, abs=1e-6)
    assert bench.run(7.0).output("head_position_command")[0] == pytest.approx(0.5, abs=1e-3)


def test_outputs_are_held():
    system = GazeController()
    assert not system.HasAnyDirectFeedthrough()
    assert Simulator(system).get_context().num_discrete_state_groups() == 1


@pytest.mark.parametrize("point", [[0, 0, 0.0], [0.0, 0.05, 0.2]])
def test_it_looks_at_the_point_on_the_object(point):
    system = GazeController(point)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("object_pose").FixValue(context, FAR)
    system.GetInputPort("X_WT").FixValue(context, X_WT)
    simulator.AdvanceTo(3.0)
    head = system.GetOutputPort("head_position_command").Eval(context)
    p_CP = (X_WT @ camera_pose(CAMERA_TOP, head)).inverse() @ (FAR @ np.array(point))
    np.testing.assert_allclose(p_CP[:2], 0, atol=1e-4)


P_TP = X_WT.inverse() @ NEAR.translation()
_BEST = choose_camera((CAMERA_TOP, CAMERA_BOTTOM), P_TP)
EYES = camera_pose(_BEST.camera, _BEST.head).translation()


def sharing(side=1.0, **inputs):
    """A head that serves the depth camera, too, and saw the object when it was old by `age`."""
    still = {"age": [0.3], "velocity": np.zeros(3), "scan_enabled": [1.0]}
    system = GazeController(secondary_camera=CAMERA_DEPTH, radius=0.042, side=side, params=SLOW)
    return Bench(NEAR, system, **{**still, **inputs})


def glances(bench, duration):
    """Yaws past the object at which the head dwells while the object was just seen."""
    middle = look_at(CAMERA_DEPTH, P_TP).head[0]
    start = bench.context.get_time()
    yaws = []
    for k in range(round(duration / 0.1)):
        head = bench.run(start + 0.1 * (k + 1)).output("head_position_command")
        if np.abs(bench.output("head_velocity_command")).max() < 0.1:
            # As low as it goes there.
            assert head[1] == pytest.approx(head_pitch_limits(head[0])[1], abs=0.05)
            yaws.append(head[0] - middle)
    return np.array(yaws)


def test_the_head_glances_to_all_sides_of_an_object_that_was_just_seen():
    yaws = glances(sharing(), 8.0)
    assert yaws.min() < -0.4
    assert yaws.max() > 0.4
    assert np.abs(yaws).min() < 0.3


def test_after_a_glance_the_object_is_looked_at_until_it_was_seen_anew():
    bench = sharing().run(2.0)
    bench.fix("age", [0.5])
    assert bench.run(4.0).output("in_view") == [1]
    looked = bench.output("head_position_command")
    np.testing.assert_allclose(bench.run(6.0).output("head_position_command"), looked, atol=1e-3)
    bench.fix("age", [0.3])
    assert np.abs(bench.run(6.5).output("head_position_command") - looked).max() > 0.1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_most_glances_go_to_the_side_of_the_arm(side):
    yaws = glances(sharing(side=side), 12.0)
    assert np.mean(yaws * side > 0.0) > 0.5


@pytest.mark.parametrize("left", [0.4, -0.4])
def test_the_first_glance_goes_to_where_something_hangs_that_may_move(left):
    steps = [[0.1, left + 0.02 * k, 0.02 * j] for k in range(3) for j in (3, 4)]
    hanging = make_cloud(NEAR.translation() + steps)
    bench = sharing(side=np.sign(left), cloud=hanging, scan_enabled=[0.0]).run(2.0)
    bench.fix("scan_enabled", [1.0])
    assert glances(bench, 2.5)[0] * np.sign(left) > 0.1


def test_an_object_that_was_not_seen_for_longer_than_a_glance_is_brought_to_the_middle():
    bench = sharing(age=[1.7]).run(3.0)
    middle = choose_camera((CAMERA_TOP, CAMERA_BOTTOM), P_TP).head
    np.testing.assert_allclose(bench.output("head_position_command"), middle, atol=1e-3)


@pytest.mark.parametrize("inputs", [{"scan_enabled": [0.0]}, {"velocity": [0.0, 0.1, 0.0]}])
def test_the_eye_stays_on_an_object_that_moves_or_when_nothing_is_to_be_watched(inputs):
    bench = sharing(**inputs).run(3.0)
    assert bench.output("in_view") == [1]
    head = bench.output("head_position_command")
    assert not np.allclose(head, look_at(CAMERA_DEPTH, P_TP).head, atol=0.05)


def test_a_missed_object_is_looked_for_above_and_below_with_all_cameras():
    bench = sharing(age=[2.0], scan_enabled=[1.0]).run(2.0)
    assert (bench.output("top_enabled"), bench.output("bottom_enabled")) == ([1], [1])
    middle = choose_camera((CAMERA_TOP, CAMERA_BOTTOM), P_TP).head[1]
    pitches = []
    for age in (2.5, 3.7):  # A quarter and three quarters of a period after it was missed.
        bench.fix("age", [age])
        pitches.append(bench.run(2.0 + 2.0 * len(pitches) + 2.0).output("head_position_command")[1])
    assert pitches[0] < middle - 0.3
    assert pitches[1] > middle + 0.2


def test_the_head_looks_where_a_moving_object_is_by_now():
    bench = sharing(age=[0.5], velocity=[0.0, 0.2, 0.0]).run(3.0)
    aimed = bench.output("head_position_command")
    now = choose_camera((CAMERA_TOP, CAMERA_BOTTOM), P_TP + [0.0, 0.5 * 0.2, 0.0]).head
    np.testing.assert_allclose(aimed, now, atol=LIMITS.following_angle)
    assert aimed[0] > choose_camera((CAMERA_TOP, CAMERA_BOTTOM), P_TP).head[0] + 0.1


def test_before_the_arm_moves_the_head_stays_where_a_lost_object_was():
    """It looked behind the robot after odometry had jumped on arrival."""
    at_rest, moving = (
        sharing(age=[2.5], velocity=velocity, scan_enabled=[0.0]).run(3.0)
        for velocity in (np.zeros(3), [-0.4, 0.1, 0.0])
    )
    np.testing.assert_allclose(*(one.output("head_position_command") for one in (at_rest, moving)))


@pytest.mark.parametrize(("speed", "enabled"), [(0.0, [0, 1]), (0.1, [1, 1])])
def test_all_cameras_look_for_a_moving_object_once_an_image_has_missed_it(speed, enabled):
    bench = sharing(age=[LIMITS.missed_age_moving + 0.1], velocity=[0.0, speed, 0.0]).run(3.0)
    assert [*bench.output("top_enabled"), *bench.output("bottom_enabled")] == enabled


@pytest.mark.parametrize(
    ("velocity", "towards"),
    [
        ([0.0, 0.1, 0.0], [1, 0]),
        ([0.0, -0.1, 0.0], [-1, 0]),
        ([0.0, 0.0, 0.1], [0, -1]),
        # Away from the eyes: the rest of a sideways motion is noise.
        (0.03 * (P_TP - EYES) / np.linalg.norm(P_TP - EYES) + [0.0, 0.002, 0.0], [0, -1]),
    ],
    ids=["to the left", "to the right", "upwards", "away"],
)
def test_a_missed_moving_object_is_searched_for_along_its_motion(velocity, towards):
    quarter = 0.25 * LIMITS.swing_period
    bench = sharing(age=[LIMITS.lead_time + quarter], velocity=velocity).run(4.0)
    p_TP = P_TP + LIMITS.lead_time * np.array(velocity)
    middle = choose_camera((CAMERA_TOP, CAMERA_BOTTOM), p_TP).head
    turn = bench.output("head_position_command") - middle
    assert turn @ towards == pytest.approx(LIMITS.swing, abs=0.05)


@pytest.mark.parametrize("speed", [0.0, 0.05])
def test_a_place_that_has_to_be_seen_is_glanced_at_and_the_goal_looked_at_again(speed):
    """Also if the goal seems to move, as one far away does with a worn robot's noise."""
    system = GazeController(secondary_camera=CAMERA_DEPTH, radius=0.03, side=-1.0, params=SLOW)
    wanted = np.array([0.6, -0.5, 0.85])
    bench = Bench(FAR, system, age=[0.1], velocity=[speed, 0.0, 0.0], look_at=wanted)

    def shows(camera, p_WP):
        X_WC = X_WT @ camera_pose(camera, bench.output("head_position_command"))
        return bool(camera.intrinsics.sees((X_WC.inverse() @ p_WP)[None])[0])

    wanted_seen, goal_seen = [], []
    for time in np.arange(0.5, 4.0, 0.1):
        bench.run(time)
        wanted_seen.append(shows(CAMERA_DEPTH, wanted))
        goal_seen.append(shows(CAMERA_TOP, FAR.translation()))
    assert any(wanted_seen)
    assert any(goal_seen[np.argmax(wanted_seen) :])
    bench.fix("look_at", np.full(3, np.nan))
    bench.run(6.0)
    assert shows(CAMERA_TOP, FAR.translation())


@pytest.mark.parametrize("late", [0.1, 0.5, 1.0])
def test_a_place_is_glanced_at_between_two_sightings_of_the_goal_however_late_these_come(late):
    system = GazeController(secondary_camera=CAMERA_DEPTH, radius=0.03, side=-1.0)
    wanted = np.array([0.6, -0.5, 0.85])
    bench = Bench(FAR, system, age=[late], velocity=np.zeros(3), look_at=wanted)
    sightings, wanted_seen, goal_seen = [0.0], [], []
    for time in np.arange(0.05, 8.0, 0.05):
        head = bench.run(time).output("head_position_command")
        shown = []
        for camera, p_WP in ((CAMERA_DEPTH, wanted), (CAMERA_TOP, FAR.translation())):
            p_CP = (X_WT @ camera_pose(camera, head)).inverse() @ p_WP
            shown.append(bool(camera.intrinsics.sees(p_CP[None])[0]))
        wanted_seen.append(shown[0])
        goal_seen.append(shown[1])
        if round(20 * time) % 4 == 0 and shown[1]:
            sightings.append(time)
        arrived = [sighting for sighting in sightings if sighting <= time - late + 1e-9]
        bench.fix("age", [time - arrived[-1] if arrived else late])
    assert any(wanted_seen)
    left = 0.05 * np.flatnonzero(np.diff(np.array(goal_seen, dtype=int)) == -1)
    assert len(left) >= 3
    assert np.diff(left).min() > late, "not before a sighting after the last glance has come"


@pytest.mark.parametrize(
    ("following_angle", "hunts"), [(0.0, True), (LIMITS.following_angle, False)]
)
def test_head_with_slack_does_not_hunt(following_angle, hunts):
    """Within its slack the head does not turn, and what it sees moves as its encoders do."""
    slack, params = np.radians(1.0), GazeParams(following_angle=following_angle)
    system = GazeController(secondary_camera=CAMERA_DEPTH, radius=0.042, params=params)
    bench = Bench(FAR, system, head_position=[0.0, 0.0], velocity=[0.1, 0.0, 0.0])
    links, heads, seen = np.zeros(2), [], [FAR.translation()] * 2
    noise = np.random.default_rng(0).normal(scale=0.003, size=(40, 3))
    for k in range(40):
        head = bench.run(0.2 * k + 0.2).output("head_position_command")
        links = np.clip(links, head - slack / 2, head + slack / 2)
        p_CO = (X_WT @ camera_pose(CAMERA_TOP, links)).inverse() @ FAR.translation()
        seen.append(X_WT @ camera_pose(CAMERA_TOP, head) @ p_CO + noise[k])
        bench.fix("object_pose", RigidTransform(seen[k]))  # Images are late.
        heads.append(head)
    assert (np.ptp(heads[20:], axis=0).max() > 0.002) == hunts
