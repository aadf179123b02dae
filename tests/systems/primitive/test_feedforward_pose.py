import numpy as np
from pydrake.math import RollPitchYaw

from pepper_drake.planning.ik.feedforward import feedforward_pose
from pepper_drake.systems.primitive.feedforward_pose import FeedforwardPose

KEY = "pepper::r_hand_effector"


def quaternion(*rpy):
    return RollPitchYaw(*rpy).ToQuaternion().wxyz()


NOW = {
    "position": np.array([0.30, -0.20, 0.10]),
    "next_position": np.array([0.31, -0.20, 0.12]),
    "orientation": quaternion(0.2, 0.3, -0.4),
    "next_orientation": quaternion(0.2, 0.3, -0.3),
}


def asked(system, inputs):
    context = system.CreateDefaultContext()
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(context, value)
    return system.bus_output.Eval(context).Find(KEY)


def test_with_a_gain_of_one_the_next_pose_is_asked_for():
    X_TH = asked(FeedforwardPose(KEY, 1.0), NOW)
    np.testing.assert_allclose(X_TH.translation(), NOW["next_position"], atol=1e-12)
    np.testing.assert_allclose(RollPitchYaw(X_TH.rotation()).vector(), [0.2, 0.3, -0.3])


def test_with_half_the_gain_the_pose_asked_for_leads_by_one_more_step():
    # X + (1 - 0.5) / 0.5 times the step, once more in position and, about z of T, in yaw.
    X_TH = asked(FeedforwardPose(KEY, 0.5), NOW)
    np.testing.assert_allclose(X_TH.translation(), [0.32, -0.2, 0.14], atol=1e-12)
    np.testing.assert_allclose(RollPitchYaw(X_TH.rotation()).vector(), [0.2, 0.3, -0.2])


def test_a_hand_that_is_on_its_path_is_asked_to_move_with_it():
    # Drake asks for gain (X_asked - X) / dt; the path moves by X_next - X_now in dt.
    for gain in (0.2, 0.7, 1.0):
        ahead = asked(FeedforwardPose(KEY, gain), NOW).translation() - NOW["position"]
        np.testing.assert_allclose(gain * ahead, NOW["next_position"] - NOW["position"])


def test_quaternions_as_they_come_out_of_an_integrator_are_taken():
    for scale in (1 + 1e-9, 1 - 1e-9):
        inputs = {**NOW, "next_orientation": scale * NOW["next_orientation"]}
        R_TH = asked(FeedforwardPose(KEY, 0.5), inputs).rotation().matrix()
        np.testing.assert_allclose(R_TH @ R_TH.T, np.eye(3), atol=1e-12)


def test_the_bus_follows_all_inputs(ports):
    bus = "desired_cartesian_poses"
    rig = ports(
        FeedforwardPose(KEY, 0.5), {bus: lambda value: value.Find(KEY).GetAsMatrix34().tolist()}
    )
    later = {
        "position": NOW["position"] + 0.01,
        "next_position": NOW["next_position"] + 0.01,
        "orientation": quaternion(0.1, 0.3, -0.4),
        "next_orientation": quaternion(0.1, 0.3, -0.3),
    }
    assert rig.changes(NOW, later) == {(name, bus) for name in NOW} == rig.feedthrough()


def test_a_path_at_rest_is_asked_for_as_it_is():
    X_TH = feedforward_pose(*[NOW["position"]] * 2, *[NOW["orientation"]] * 2, 0.3)
    np.testing.assert_allclose(X_TH.translation(), NOW["position"])
    np.testing.assert_allclose(RollPitchYaw(X_TH.rotation()).vector(), [0.2, 0.3, -0.4])
