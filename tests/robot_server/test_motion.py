import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from virtual_pepper import CALLER, VirtualPepper, virtual

from pepper_drake.models.pepper import elbow_roll_limits, head_pitch_limits
from pepper_drake.naoqi.constants import BODY, CHAINS, CYCLE, JOINTS
from pepper_drake.robot_server.robot.robot_model import JOINT_LIMITS, LOWER, MAX_VELOCITY, UPPER
from pepper_drake.robot_server.services.postures import NAOQI_POSTURES
from pepper_drake.robot_server.wire.service import Caller, ServiceError


def _commands(pepper: VirtualPepper) -> np.ndarray:
    return np.array([command.positions for command in pepper.history])


def _joint(pepper: VirtualPepper, joint: str) -> np.ndarray:
    return _commands(pepper)[:, JOINTS.index(joint)]


def test_set_angles_returns_at_once_and_arrives_in_its_time():
    async def scenario(pepper):
        assert pepper.call("ALMotion.setAngles", "HeadYaw", 1.0, 0.1) is None
        assert pepper.angle("HeadYaw") == 0.0
        speed = 0.1 * JOINT_LIMITS["HeadYaw"].velocity
        await pepper.run(0.5 / speed)
        assert 0.3 < pepper.angle("HeadYaw") < 0.55
        await pepper.run(0.5 / speed + 0.3)
        assert pepper.angle("HeadYaw") == pytest.approx(1.0)
        assert np.abs(np.diff(_joint(pepper, "HeadYaw"))).max() <= speed * CYCLE + 1e-9

    virtual(scenario)


def test_set_angles_takes_a_new_target_at_once_with_continuous_velocity():
    async def scenario(pepper):
        pepper.call("ALMotion.setAngles", "HeadYaw", math.pi / 2, 0.1)
        await pepper.run(1.0)
        before = pepper.angle("HeadYaw")
        pepper.call("ALMotion.setAngles", ["HeadYaw"], [-math.pi / 6], 1.0)
        await pepper.run(0.1)
        assert pepper.angle("HeadYaw") < before
        await pepper.run(2.0)
        assert pepper.angle("HeadYaw") == pytest.approx(-math.pi / 6)
        change = np.diff(_joint(pepper, "HeadYaw"), 2) / CYCLE**2
        assert np.abs(change).max() <= JOINT_LIMITS["HeadYaw"].velocity / 0.2 + 1e-6

    virtual(scenario)


def test_change_angles_is_relative_to_the_command():
    async def scenario(pepper):
        pepper.call("ALMotion.setAngles", "HeadYaw", 0.5, 0.5)
        await pepper.run(1.0)
        pepper.call("ALMotion.changeAngles", "HeadYaw", -0.2, 0.5)
        await pepper.run(1.0)
        assert pepper.angle("HeadYaw") == pytest.approx(0.3)

    virtual(scenario)


def test_set_angles_with_a_fraction_for_each_joint():
    async def scenario(pepper):
        overload = [
            m
            for m in pepper.services["ALMotion"].overloads("setAngles")
            if m.parameters == "(mm[f])"
        ]
        overload[0].handler(CALLER, ["HeadYaw", "HeadPitch"], [1.0, 0.2], [0.05, 0.5])
        await pepper.run(0.4)
        assert pepper.angle("HeadPitch") == pytest.approx(0.2)
        assert 0 < pepper.angle("HeadYaw") < 0.2

    virtual(scenario)


def test_at_stiffness_zero_the_command_follows_the_hand_and_nothing_moves():
    async def scenario(pepper):
        pepper.call("ALMotion.setStiffnesses", "RArm", 0.0)
        pepper.call("ALMotion.setAngles", "RElbowRoll", 1.0, 0.5)
        await pepper.run(1.0)
        assert pepper.angle("RElbowRoll") == pytest.approx(LOWER[JOINTS.index("RElbowRoll")])
        pepper.robot.lead({"RElbowRoll": 0.7})
        await pepper.run(2 * CYCLE)
        assert pepper.angle("RElbowRoll") == pytest.approx(0.7)
        assert pepper.call("ALMotion.getAngles", "RElbowRoll", False) == pytest.approx([0.7])
        pepper.call("ALMotion.setStiffnesses", "RArm", 1.0)
        await pepper.run(1.0)
        assert pepper.angle("RElbowRoll") == pytest.approx(0.7), "the arm jumped when made stiff"

    virtual(scenario)


def test_stiffness_made_zero_on_the_way_ends_the_way():
    async def scenario(pepper):
        pepper.call("ALMotion.setAngles", "HeadYaw", 1.5, 0.1)
        await pepper.run(0.5)
        pepper.call("ALMotion.setStiffnesses", "Head", 0)
        await pepper.run(0.1)
        stopped = pepper.angle("HeadYaw")
        pepper.call("ALMotion.setStiffnesses", "Head", 1)
        await pepper.run(2.0)
        assert 0.2 < stopped < 0.5
        assert pepper.angle("HeadYaw") == pytest.approx(stopped)

    virtual(scenario)


def test_the_lower_body_refuses_stiffness_without_a_word():
    async def scenario(pepper):
        pepper.call("ALMotion.setStiffnesses", "Body", 0.3)
        expected = [1.0 if joint in CHAINS["Leg"] else 0.3 for joint in JOINTS] + [1.0] * 3
        assert pepper.call("ALMotion.getStiffnesses", "Body") == pytest.approx(expected)
        pepper.call("ALMotion.setStiffnesses", "KneePitch", 0.0)
        assert pepper.call("ALMotion.getStiffnesses", "KneePitch") == [1.0]

    virtual(scenario)


def test_stiffness_interpolation_is_a_ramp():
    async def scenario(pepper):
        call = pepper.start("ALMotion.stiffnessInterpolation", "RArm", 0.0, 0.5)
        await pepper.run(0.25)
        assert pepper.call("ALMotion.getStiffnesses", "RWristYaw") == pytest.approx([0.5], abs=0.05)
        await pepper.finish(call)
        assert pepper.call("ALMotion.getStiffnesses", "RArm") == [0.0] * 6

    virtual(scenario)


def test_a_second_interpolation_is_postponed_not_refused():
    async def scenario(pepper):
        first = pepper.start("ALMotion.angleInterpolation", "HeadYaw", 1.0, 2.0, True)
        await pepper.run(0.5)
        second = pepper.start("ALMotion.angleInterpolation", "HeadYaw", -0.5, 1.0, True)
        await pepper.cycle()
        assert pepper.call("ALMotion.getTaskList") == [
            ["angleInterpolation", 1],
            ["angleInterpolation", 2],
        ]
        assert not pepper.call("ALMotion.areResourcesAvailable", ["Head"])
        assert pepper.call("ALMotion.areResourcesAvailable", ["HeadPitch", "LArm"])
        await pepper.finish(first)
        assert pepper.angle("HeadYaw") == pytest.approx(1.0)
        assert not second.done()
        took = await pepper.finish(second)
        assert took == pytest.approx(1.0, abs=3 * CYCLE)
        assert pepper.angle("HeadYaw") == pytest.approx(-0.5)
        assert pepper.call("ALMotion.getTaskList") == []

    virtual(scenario)


def test_an_interpolation_takes_its_times_and_passes_its_keys():
    async def scenario(pepper):
        call = pepper.start(
            "ALMotion.angleInterpolation",
            ["HeadYaw", "HeadPitch"],
            [[0.8, 0.0], [-0.4, 0.3, 0.0]],
            [[1.0, 2.0], [1.0, 2.0, 3.0]],
            True,
        )
        assert await pepper.finish(call) == pytest.approx(3.0, abs=3 * CYCLE)
        yaw, pitch = _joint(pepper, "HeadYaw"), _joint(pepper, "HeadPitch")
        assert yaw.max() == pytest.approx(0.8, abs=1e-6)
        assert np.argmax(yaw) * CYCLE == pytest.approx(1.0, abs=3 * CYCLE)
        assert (pitch.min(), pitch.max()) == pytest.approx((-0.4, 0.3), abs=1e-6)

    virtual(scenario)


def test_a_relative_interpolation_adds_to_where_it_starts():
    async def scenario(pepper):
        await pepper.finish(pepper.start("ALMotion.angleInterpolation", "HeadYaw", 0.5, 1.0, True))
        await pepper.finish(pepper.start("ALMotion.angleInterpolation", "HeadYaw", 0.2, 1.0, False))
        assert pepper.angle("HeadYaw") == pytest.approx(0.7)

    virtual(scenario)


def test_an_interpolation_too_fast_for_the_joint_is_slowed_not_broken():
    async def scenario(pepper):
        call = pepper.start("ALMotion.angleInterpolation", "HeadYaw", 2.0, 0.1, True)
        took = await pepper.finish(call)
        assert took >= 2.0 / JOINT_LIMITS["HeadYaw"].velocity
        assert pepper.angle("HeadYaw") == pytest.approx(2.0)
        speed = np.abs(np.diff(_joint(pepper, "HeadYaw"))).max() / CYCLE
        assert speed <= JOINT_LIMITS["HeadYaw"].velocity + 1e-6
        assert _joint(pepper, "HeadYaw").max() <= 2.0 + 1e-9

    virtual(scenario)


def test_interpolation_with_speed_keeps_the_fraction():
    async def scenario(pepper):
        call = pepper.start(
            "ALMotion.angleInterpolationWithSpeed", ["HeadYaw", "HeadPitch"], [1.0, 0.2], 0.2
        )
        took = await pepper.finish(call)
        fastest = np.abs(np.diff(_joint(pepper, "HeadYaw"))).max() / CYCLE
        assert fastest == pytest.approx(0.2 * JOINT_LIMITS["HeadYaw"].velocity, rel=0.02)
        assert took == pytest.approx(1.5 / (0.2 * JOINT_LIMITS["HeadYaw"].velocity), abs=0.06)
        assert pepper.angle("HeadPitch") == pytest.approx(0.2)

    virtual(scenario)


def test_bezier_as_a_drawing_program_exports_it():
    async def scenario(pepper):
        call = pepper.start(
            "ALMotion.angleInterpolationBezier",
            ["HeadYaw", "RShoulderPitch"],
            [[1.0, 2.0], [1.0]],
            [
                [[0.5, [3, -0.33, 0.0], [3, 0.33, 0.0]], [0.1, [3, -0.33, 0.0], [3, 0.0, 0.0]]],
                [[1.2, [3, -0.33, 0.0], [3, 0.0, 0.0]]],
            ],
        )
        assert await pepper.finish(call) == pytest.approx(2.0, abs=3 * CYCLE)
        assert _joint(pepper, "HeadYaw").max() == pytest.approx(0.5, abs=1e-3)
        assert pepper.angle("HeadYaw") == pytest.approx(0.1)
        assert pepper.angle("RShoulderPitch") == pytest.approx(1.2)

    virtual(scenario)


def test_kill_task_brakes_smoothly_and_its_caller_returns():
    async def scenario(pepper):
        call = pepper.start("ALMotion.angleInterpolation", "HeadYaw", 2.0, 1.0, True)
        await pepper.run(0.5)
        ((name, number),) = pepper.call("ALMotion.getTaskList")
        assert name == "angleInterpolation"
        assert pepper.call("ALMotion.killTask", number)
        assert not pepper.call("ALMotion.killTask", number)
        await pepper.finish(call)
        await pepper.run(1.0)
        path = _joint(pepper, "HeadYaw")
        assert 1.0 < path[-1] < 1.8
        assert np.diff(path).min() >= -1e-9, "it went back"
        jump = np.abs(np.diff(path, 2)) / CYCLE**2
        assert jump.max() <= JOINT_LIMITS["HeadYaw"].velocity / 0.2 + 1e-6

    virtual(scenario)


def test_kill_all_stops_targets_and_tasks_and_the_base():
    async def scenario(pepper):
        pepper.call("ALMotion.setAngles", "HeadPitch", 0.4, 0.02)
        pepper.call("ALMotion.move", 0.2, 0.0, 0.0)
        call = pepper.start("ALMotion.angleInterpolation", "RArm", [0.5] * 6, [5.0] * 6, True)
        await pepper.run(1.0)
        pepper.call("ALMotion.killAll")
        await pepper.finish(call)
        await pepper.run(1.0)
        before = pepper.motion.joints.command.copy()
        await pepper.run(0.5)
        np.testing.assert_allclose(pepper.motion.joints.command, before)
        assert pepper.call("ALMotion.getRobotVelocity") == [0, 0, 0]

    virtual(scenario)


def test_cancelling_a_call_kills_its_task():
    async def scenario(pepper):
        call = pepper.start("ALMotion.angleInterpolation", "HeadYaw", 2.0, 4.0, True)
        await pepper.run(1.0)
        call.cancel()
        await pepper.run(0.5)
        assert pepper.call("ALMotion.getTaskList") == []
        assert pepper.angle("HeadYaw") < 1.0

    virtual(scenario)


def test_set_angles_takes_a_joint_from_a_running_interpolation_and_leaves_the_others():
    async def scenario(pepper):
        call = pepper.start(
            "ALMotion.angleInterpolation", ["HeadYaw", "HeadPitch"], [1.0, 0.3], [2.0, 2.0], True
        )
        await pepper.run(1.0)
        pepper.call("ALMotion.setAngles", "HeadYaw", -0.3, 0.3)
        await pepper.finish(call)
        await pepper.run(0.5)
        assert pepper.angle("HeadYaw") == pytest.approx(-0.3)
        assert pepper.angle("HeadPitch") == pytest.approx(0.3)

    virtual(scenario)


@given(
    st.lists(
        st.tuples(
            st.dictionaries(st.sampled_from(JOINTS), st.floats(-4, 4), min_size=1),
            st.floats(0.01, 1.0),
            st.integers(1, 20),
        ),
        min_size=1,
        max_size=6,
    )
)
@settings(max_examples=40, deadline=None)
def test_no_command_ever_passes_a_limit(sequence):
    async def scenario(pepper):
        for targets, fraction, cycles in sequence:
            pepper.call("ALMotion.setAngles", list(targets), list(targets.values()), fraction)
            await pepper.run(cycles * CYCLE)
        commands = _commands(pepper)
        assert (commands >= LOWER - 1e-12).all()
        assert (commands <= UPPER + 1e-12).all()
        assert (np.abs(np.diff(commands, axis=0)) <= MAX_VELOCITY * CYCLE + 1e-9).all()
        for row in commands:
            at = dict(zip(JOINTS, row, strict=True))
            for value, (lower, upper) in (
                (at["HeadPitch"], head_pitch_limits(at["HeadYaw"])),
                (at["LElbowRoll"], elbow_roll_limits(at["LElbowYaw"], "left")),
                (at["RElbowRoll"], elbow_roll_limits(at["RElbowYaw"], "right")),
            ):
                assert lower - 1e-12 <= value <= upper + 1e-12

    virtual(scenario)


def test_wake_up_and_rest_take_their_time_and_tell():
    async def scenario(pepper):
        told = []
        pepper.call("ALMemory.subscriber", "robotIsWakeUp").emitters.append(
            lambda _s, _u, _p, arguments: told.append(arguments[0])
        )
        assert not pepper.call("ALMotion.robotIsWakeUp")
        assert pepper.call("ALMotion.getStiffnesses", "Body") == [0.0] * 20
        await pepper.finish(pepper.start("ALMotion.wakeUp"))
        assert pepper.call("ALMotion.robotIsWakeUp")
        assert pepper.call("ALMotion.getStiffnesses", "Body") == [1.0] * 20
        assert pepper.call("ALRobotPosture.getPostureFamily") == "Standing"
        assert await pepper.finish(pepper.start("ALMotion.wakeUp")) <= 2 * CYCLE
        assert await pepper.finish(pepper.start("ALMotion.rest")) > 0.5
        assert pepper.call("ALRobotPosture.getPosture") == "Crouch"
        assert pepper.call("ALMotion.getStiffnesses", "Body") == [0.0] * 20
        assert told == [True, False]

    virtual(scenario, awake=False)


def test_rest_of_one_chain_makes_only_that_limp():
    async def scenario(pepper):
        await pepper.finish(pepper.start("ALMotion.rest", "LArm"))
        assert pepper.call("ALMotion.getStiffnesses", ["LArm", "Head"]) == [0.0] * 6 + [1.0] * 2

    virtual(scenario)


def test_hands_open_and_close_and_a_limp_one_is_limp_again():
    async def scenario(pepper):
        await pepper.finish(pepper.start("ALMotion.openHand", "RHand"))
        assert pepper.angle("RHand") == pytest.approx(1.0)
        pepper.call("ALMotion.setStiffnesses", "LHand", 0.0)
        await pepper.finish(pepper.start("ALMotion.closeHand", "LHand"))
        assert pepper.angle("LHand") == pytest.approx(0.0)
        assert pepper.call("ALMotion.getStiffnesses", "LHand") == [0.0]
        with pytest.raises(ServiceError, match="ALMotion::openHand: there is no hand 'RArm'"):
            await pepper.call("ALMotion.openHand", "RArm")

    virtual(scenario)


def test_names_and_numbers_of_the_body():
    async def scenario(pepper):
        assert pepper.call("ALMotion.getBodyNames", "Body") == list(BODY)
        assert len(BODY) == 20
        assert pepper.call("ALMotion.getBodyNames", "Chains") == ["Head", "LArm", "Leg", "RArm"]
        assert len(pepper.call("ALMotion.getAngles", "Body", True)) == 20
        assert pepper.call("ALMotion.getAngles", ["LHand", "Head"], True) == [0.5, 0.0, 0.0]
        ((lower, upper, speed, torque),) = pepper.call("ALMotion.getLimits", "RShoulderRoll")
        assert (lower, upper) == pytest.approx((-1.56207, -0.00872665))
        assert (speed, torque) == pytest.approx((9.22756, 2.666))
        assert len(pepper.call("ALMotion.getLimits", "Body")) == 20
        names, values = pepper.call("ALMotion.getRobotConfig")
        assert dict(zip(names, values, strict=True))["Model Type"] == "juliette"
        summary = pepper.call("ALMotion.getSummary")
        assert all(name in summary for name in BODY)
        assert pepper.call("ALMotion.getMotionCycleTime") == 20

    virtual(scenario)


def test_frames_are_where_the_maker_says():
    async def scenario(pepper):
        pepper.call("ALMotion.setStiffnesses", "Body", 0.0)
        await pepper.cycle()
        pepper.robot.lead(dict.fromkeys(JOINTS, 0.0))
        await pepper.cycle()
        # Figures of the maker's pages on links and cameras, at the zero posture; the forearm is
        # bent up by 9 degrees against the upper arm.
        bend = 0.157079
        x, z = 0.15 + 0.0695, -0.0303
        expected = (
            -0.057 + 0.1812 + x * math.cos(bend) - z * math.sin(bend),
            -0.14974 - 0.015,
            0.08682 + x * math.sin(bend) + z * math.cos(bend),
        )
        position = pepper.call("ALMotion.getPosition", "RArm", 0, True)
        assert position[:3] == pytest.approx(expected, abs=2e-4)
        assert position[3:] == pytest.approx([0.0, -bend, 0.0], abs=1e-6)
        assert pepper.call("ALMotion.getPosition", "Torso", 2, True)[2] == pytest.approx(0.82)
        camera = pepper.call("ALMotion.getPosition", "CameraBottom", 2, True)
        assert camera[2] == pytest.approx(1.052, abs=1e-3)
        assert camera[4] == pytest.approx(math.radians(40), abs=1e-3)
        matrix = np.reshape(pepper.call("ALMotion.getTransform", "CameraBottom", 2, True), (4, 4))
        np.testing.assert_allclose(matrix[:3, 3], camera[:3], atol=1e-9)
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-9)
        with pytest.raises(ServiceError, match="ALMotion::getPosition: there is no joint"):
            pepper.call("ALMotion.getPosition", "Tail", 0, True)
        with pytest.raises(ServiceError, match="frame is 7"):
            pepper.call("ALMotion.getPosition", "RArm", 7, True)

    virtual(scenario)


def test_a_sensor_is_where_it_was_when_the_image_was_taken():
    async def scenario(pepper):
        pepper.call("ALMotion.setAngles", "HeadYaw", 1.0, 0.1)
        await pepper.run(0.5)
        then = pepper.robot.now
        there = pepper.call("ALMotion.getTransform", "CameraTop", 1, True)
        await pepper.run(0.5)
        seconds = int(then)
        stamp = (seconds, round((then - seconds) * 1e6))
        found = pepper.call("ALMotion._getSensorTransformAtTime", "CameraTop", stamp)
        np.testing.assert_allclose(found, there, atol=1e-5)
        with pytest.raises(ServiceError, match="nothing is known"):
            pepper.call("ALMotion._getSensorTransformAtTime", "CameraTop", (seconds - 60, 0))

    virtual(scenario)


def test_postures_lie_within_limits_where_the_maker_put_them():
    async def scenario(pepper):
        for name in ("Crouch", "StandZero", "StandInit", "Stand"):
            done = pepper.start("ALRobotPosture.goToPosture", name, 0.8)
            await pepper.finish(done)
            assert done.result() is True
            assert pepper.call("ALRobotPosture.getPosture") in (name, "Stand", "StandInit")
        assert pepper.angle("LElbowYaw") == pytest.approx(NAOQI_POSTURES["Stand"]["LElbowYaw"])
        unknown = pepper.start("ALRobotPosture.goToPosture", "Sit", 0.8)
        await pepper.finish(unknown)
        assert unknown.result() is False
        stopped = pepper.start("ALRobotPosture.goToPosture", "Crouch", 0.05)
        await pepper.run(0.5)
        pepper.call("ALRobotPosture.stopMove")
        await pepper.finish(stopped)
        assert stopped.result() is False
        told = pepper.call("ALMemory.getData", "PostureFamilyChanged")
        assert told == "Standing"

    virtual(scenario)


def test_the_log_says_once_whose_joints_another_client_takes():
    async def scenario(pepper):
        other = Caller(client=2, address="10.0.0.2")
        for _ in range(3):
            pepper.call("ALMotion.setAngles", "Head", 0.0, 0.1)
            pepper.call("ALMotion.setAngles", "HeadYaw", 0.1, 0.1, caller=other)
        taken = "client 2 (10.0.0.2) moves HeadYaw, which client 1 was moving"
        back = "client 1 moves HeadYaw, which client 2 (10.0.0.2) was moving"
        assert pepper.lines == [taken, back]
        await pepper.run(2.0)
        pepper.call("ALMotion.move", 0.1, 0.0, 0.0)
        await pepper.run(2.0)
        pepper.call("ALMotion.move", 0.1, 0.0, 0.0, caller=other)
        assert len(pepper.lines) == 2
        await pepper.run(0.1)
        assert pepper.angle("HeadYaw") == pytest.approx(0.1)

    virtual(scenario)
