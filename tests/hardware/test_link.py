"""A link to a served robot: what it streams, and what it does when something is wrong."""

import asyncio
import time
from functools import partial

import numpy as np
import pytest
from served import served

from pepper_drake.hardware.arm_stream import HOLD_FRACTION
from pepper_drake.hardware.link import RobotLink
from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_config import LinkConfig
from pepper_drake.hardware.mailbox import CAMERA_NAMES, END, HAND_OVER, HOLD, STREAM, Mailbox
from pepper_drake.hardware.robot_commands import HEADROOM, base_segment, streamed_targets
from pepper_drake.hardware.state_reader import StateReader
from pepper_drake.hardware.transport import RobotAccess, make_transport
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.naoqi.constants import BODY, JOINTS
from pepper_drake.robot_server.robot.joint_controller import JointController
from pepper_drake.robot_server.robot.robot_model import MAX_VELOCITY
from pepper_drake.robot_server.robot.robot_port import CameraImage, KinematicRobot

ARM = list(arm_joints("right"))
ROWS = body_indices(ARM)
RIGHT_HAND = JOINTS.index("RHand")
NAOQI = [JOINTS.index(name) for name in ARM]
START = np.array([1.3, -0.3, 1.0, 0.8, 0.0])
GOAL = np.array([0.5, -0.5, 0.6, 1.2, 0.4])


def test_a_base_that_turns_round_and_round_is_measured_without_a_step():
    class Robot:
        yaw = 0.0

        async def call(self, _service, method, *_arguments):
            now = time.monotonic()
            answers = {
                "getTimestamp": [0.0, int(now), int(now % 1.0 * 1e6)],
                "getAngles": [0.0] * len(BODY),
                "getRobotPosition": [1.0, 2.0, self.yaw],
            }
            return answers[method]

    async def read():
        robot, found, questions = Robot(), [], []
        reader = StateReader(robot, LinkClock())

        def start(question):
            questions.append(asyncio.create_task(question))
            return questions[-1]

        for robot.yaw in (3.0, 3.1, -3.1, -3.0):
            reader.ask(start)
            await questions[-1]
            found.append(reader.measured.newest.base_pose[2])
        return found

    full = 2 * np.pi
    assert asyncio.run(read()) == pytest.approx([3.0, 3.1, full - 3.1, full - 3.0])


def minimum_jerk(t, duration):
    s = np.clip(t / duration, 0.0, 1.0)
    return START + (GOAL - START) * (10 * s**3 - 15 * s**4 + 6 * s**5)


class Led:
    """A link on the test's loop, and the station's side of its mailbox."""

    def __init__(self, robot, mailbox, link, transport):
        self.robot, self.mailbox, self.link, self.transport = robot, mailbox, link, transport
        self.body = np.zeros(len(BODY_JOINTS))

    def command(self, arm, velocity=None, mode=STREAM, **fields):
        self.body[ROWS] = arm
        velocities = np.zeros(len(BODY_JOINTS))
        velocities[ROWS] = 0.0 if velocity is None else velocity
        self.mailbox.command.write(
            time=time.monotonic(),
            mode=mode,
            positions=self.body,
            velocities=velocities,
            **fields,
        )

    def state(self):
        return self.mailbox.state.read()

    def arm(self):
        return self.robot.do(lambda: self.robot.robot.state().positions[NAOQI])

    async def play(self, path, seconds, still=lambda: False):
        """Commands a path for a time, one command each 20 ms."""
        begin = time.monotonic()
        while time.monotonic() - begin < seconds and not still():
            t = time.monotonic() - begin
            velocity = (path(t + 0.01) - path(t - 0.01)) / 0.02
            self.command(path(t), velocity)
            await asyncio.sleep(0.02)

    async def keep_looking(self):
        while True:
            self.command(START, enabled=[True, False, False])
            await asyncio.sleep(0.02)

    async def fault(self, seconds=5.0):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if str(self.state()["fault"]):
                return str(self.state()["fault"])
            await asyncio.sleep(0.01)
        return ""


def led(scenario, **options):
    """Runs a scenario with a link to a served robot whose right arm is at START."""

    async def run(robot):
        mailbox = Mailbox()
        transport = make_transport(RobotAccess(robot.address))
        again = partial(make_transport, RobotAccess(robot.address))
        # The tests share this computer: what is late is judged by the test of it alone.
        config = LinkConfig("right", **{"late_cycles": 100} | options)
        link = RobotLink(transport, mailbox, config, reconnect=again)
        it = Led(robot, mailbox, link, transport)
        await transport.connect()
        task = asyncio.ensure_future(link.run())
        try:
            while int(it.state()["states"]) == 0:
                await asyncio.sleep(0.01)
            it.body[:] = it.state()["positions"]
            await scenario(it)
        finally:
            it.mailbox.command.write(mode=END)
            await asyncio.wait_for(task, 10)
            await transport.close()
            mailbox.close()

    with served() as robot:
        place(robot)
        asyncio.run(run(robot))


def place(robot):
    """Puts the arm to START; a robot whose first cycle is not over yet would go back."""
    end, commands = time.monotonic() + 5.0, robot.robot.commands
    is_there = False
    while not is_there and time.monotonic() < end:
        robot.do(lambda: put(robot))
        after = len(commands) + 2
        while len(commands) < after and time.monotonic() < end:
            time.sleep(0.005)
        arm = robot.do(lambda: robot.robot.state().positions[NAOQI])
        is_there = np.allclose(arm, START, atol=1e-3)
    assert is_there


def put(robot):
    robot.robot.lead(dict(zip(ARM, START.tolist(), strict=True)))
    controller = robot.pepper.motion.joints
    controller.command[NAOQI] = START
    controller._target[NAOQI] = START


def test_a_streamed_path_is_followed_smoothly_and_ends_where_it_shall():
    async def scenario(it):
        first = len(it.robot.robot.commands)
        await it.play(lambda t: minimum_jerk(t, 2.0), 3.0)
        assert not str(it.state()["fault"]), it.state()["detail"]
        np.testing.assert_allclose(it.arm(), GOAL, atol=1e-3)
        commands = it.robot.do(lambda: [c.positions[NAOQI] for c in it.robot.robot.commands])
        path = np.array(commands[first:])
        steps = np.abs(np.diff(path, axis=0))
        # As fast as the plan at its peak, 1.875 over the mean; where it catches up after a pause of
        # this machine, with the headroom or the fraction of a hold.
        peak = 1.875 * np.abs(GOAL - START).max() / 2.0
        fastest = max(HEADROOM * peak / MAX_VELOCITY[NAOQI].min(), HOLD_FRACTION)
        assert np.all(steps.max(axis=0) < 1.05 * fastest * MAX_VELOCITY[NAOQI] * 0.02)
        assert np.all(steps <= MAX_VELOCITY[NAOQI] * 0.02 + 1e-12)

    led(scenario)


@pytest.mark.parametrize("ahead", [0.06, 0.1, 0.15])
def test_all_joints_are_at_the_same_point_of_the_path(ahead):
    # In virtual time, with ALMotion's law as it is served.
    state = KinematicRobot().state()
    controller = JointController(state)
    controller.stiffness[:] = 1.0
    controller.command[NAOQI] = START
    limits = shared_control_model().command_limits(ARM)
    for k in range(150):
        t = 0.02 * k
        velocity = (minimum_jerk(t, 3.0) - minimum_jerk(t - 0.02, 3.0)) / 0.02
        targets, fraction = streamed_targets(ARM, minimum_jerk(t, 3.0), velocity, ahead, limits)
        controller.set_targets(dict(zip(ARM, targets.tolist(), strict=True)), fraction)
        controller.step(state)
        share = (controller.command[NAOQI] - START) / (GOAL - START)
        assert np.ptp(share) < 1e-3
        # One lookahead less one cycle ahead of the path.
        expected = minimum_jerk(t + ahead, 3.0)
        np.testing.assert_allclose(controller.command[NAOQI], expected, atol=0.02)


def test_when_the_planner_is_silent_the_arm_stops_by_itself():
    async def scenario(it):
        await it.play(lambda t: START + 0.3 * t, 0.6)
        await asyncio.sleep(0.25)
        stopped = it.arm()
        await asyncio.sleep(0.3)
        np.testing.assert_allclose(it.arm(), stopped, atol=1e-3)
        assert np.all(np.abs(stopped - START) < 0.3)  # Not much farther than it was led.

    led(scenario)


def test_nothing_moves_before_the_first_command_and_while_held():
    async def scenario(it):
        await asyncio.sleep(0.2)
        np.testing.assert_allclose(it.arm(), START, atol=1e-6)
        it.command(GOAL, mode=HOLD)
        await asyncio.sleep(0.3)
        np.testing.assert_allclose(it.arm(), START, atol=1e-6)

    led(scenario)


def test_a_command_beyond_the_limits_is_sent_within_them():
    async def scenario(it):
        far = np.array([3.0, -0.5, 2.5, 2.0, 2.5])
        await it.play(lambda t: START + (far - START) * min(t / 1.0, 1.0), 2.0)
        lower, upper = (
            it.link._arm.limits.position_lower[2:],
            it.link._arm.limits.position_upper[2:],
        )
        commands = it.robot.do(lambda: [c.positions[NAOQI] for c in it.robot.robot.commands])
        assert np.all(np.array(commands) <= upper + 1e-9)
        assert np.all(np.array(commands) >= lower - 1e-9)

    led(scenario)


def test_images_come_with_the_joints_of_their_capture():
    async def scenario(it):
        color = np.arange(480 * 640 * 3, dtype=np.uint32).reshape(480, 640, 3).astype(np.uint8)
        depth = np.full((240, 320), 1.234, np.float32)

        def take():
            now = it.robot.robot.now
            it.robot.robot.images = {0: CameraImage(now, color), 2: CameraImage(now, depth)}

        top, bottom, deep = (record for record in it.mailbox.images)
        end = time.monotonic() + 5.0
        while min(top.writes, deep.writes) <= 3 and time.monotonic() < end:
            it.robot.do(take)
            it.command(START, enabled=[True, False, True])
            await asyncio.sleep(0.05)
        assert bottom.writes == 0
        assert top.writes > 3
        assert deep.writes > 3
        image = top.read()
        np.testing.assert_array_equal(image["pixels"][: color.size].reshape(color.shape), color)
        np.testing.assert_allclose(image["positions"][ROWS], START, atol=1e-6)
        assert 0 < time.monotonic() - image["time"] < 0.5
        depth_mm = np.array(deep.read()["pixels"])[: 2 * 240 * 320].view(np.uint16)
        assert set(depth_mm.tolist()) == {1234}
        assert sorted(it.robot.do(it.robot.pepper.video.get_subscribers)) == [
            "pepper_drake_0_0",
            "pepper_drake_2_0",
        ]
        it.command(START, enabled=[False] * len(CAMERA_NAMES))
        end = time.monotonic() + 2.0
        while it.robot.do(it.robot.pepper.video.get_subscribers) and time.monotonic() < end:
            await asyncio.sleep(0.02)
        assert it.robot.do(it.robot.pepper.video.get_subscribers) == []

    led(scenario)


def test_the_arm_is_handed_over_hanging_and_soft():
    async def scenario(it):
        await it.play(lambda t: minimum_jerk(t, 1.0), 1.5)
        it.command(GOAL, mode=HAND_OVER)
        for _ in range(200):
            await asyncio.sleep(0.05)
            if str(it.state()["phase"]) == "handed over":
                break
        assert not str(it.state()["fault"]), it.state()["detail"]
        assert it.arm()[0] > 1.15
        stiffness = it.robot.do(lambda: it.robot.pepper.motion.get_stiffnesses(ARM))
        np.testing.assert_allclose(stiffness, 0.3, atol=1e-6)

    led(scenario)


def test_the_base_goes_where_it_is_led_and_stops():
    async def scenario(it):
        goal = 0.3
        for _ in range(500):
            x = float(it.state()["base_pose"][0])
            left = goal - x
            speed = min(0.35, np.sqrt(2 * 0.3 * max(left, 0.0)), 5 * left)
            it.command(START, base_velocity=[speed, 0.0, 0.0])
            await asyncio.sleep(0.02)
            if abs(left) < 0.004:
                break
        it.command(START, base_velocity=[0.0, 0.0, 0.0])
        await asyncio.sleep(0.3)
        assert abs(float(it.state()["base_pose"][0]) - goal) < 0.006

    led(scenario)


@pytest.mark.parametrize("left", [0.001, 0.01, 0.1, 1.0])
def test_a_segment_never_leads_beyond_the_goal(left):
    speed = min(0.35, np.sqrt(2 * 0.3 * left), 5 * left)
    segment = base_segment(np.array([0.6 * speed, 0.8 * speed, 0.0]))
    assert segment is not None
    assert np.hypot(*segment[:2]) <= min(left, 0.2) + 1e-12
    np.testing.assert_allclose(segment[0] / segment[1], 0.75)


def test_no_segment_for_standing_still_or_no_number():
    assert base_segment(np.zeros(3)) is None
    assert base_segment(np.array([np.nan, 0.0, 0.0])) is None


def test_a_hand_opens_and_closes_once_as_it_is_told_and_is_left_soft():
    async def scenario(it):
        def hand(name="RHand"):
            return it.robot.do(lambda: it.robot.robot.state().positions[JOINTS.index(name)])

        for wanted in (1.0, 0.0):
            end = time.monotonic() + 5.0
            while abs(hand() - wanted) > 0.01 and time.monotonic() < end:
                it.command(START, hands=[np.nan, wanted])
                await asyncio.sleep(0.02)
            assert hand() == pytest.approx(wanted, abs=0.01)
            assert it.state()["hands"] == pytest.approx([0.5, wanted], abs=0.2)
        assert hand("LHand") == 0.5
        stiffness.append(it.robot.pepper.motion.joints.stiffness)
        assert stiffness[0][RIGHT_HAND] == 1.0

    stiffness = []
    led(scenario)
    assert stiffness[0][RIGHT_HAND] == pytest.approx(0.3)
