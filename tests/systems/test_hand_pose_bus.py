import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from pepper_drake.systems.hand_pose_bus import HandPoseBus

P, Q = [0.3, -0.2, 0.1], RollPitchYaw(0.2, 0.3, -0.4).ToQuaternion().wxyz()


def test_the_bus_carries_the_pose_under_its_key():
    system = HandPoseBus("pepper::r_hand_effector")
    context = system.CreateDefaultContext()
    system.position_input.FixValue(context, P)
    system.orientation_input.FixValue(context, Q)
    bus = system.bus_output.Eval(context)
    X_TH = bus.Find("pepper::r_hand_effector")
    np.testing.assert_array_equal(X_TH.translation(), P)
    np.testing.assert_allclose(RollPitchYaw(X_TH.rotation()).vector(), [0.2, 0.3, -0.4])


@pytest.mark.parametrize("scale", [1 + 1e-9, 1 - 1e-9])
def test_a_quaternion_as_it_comes_out_of_an_integrator_is_taken(scale):
    system = HandPoseBus("hand")
    context = system.CreateDefaultContext()
    system.position_input.FixValue(context, P)
    system.orientation_input.FixValue(context, scale * Q)
    R_TH = system.bus_output.Eval(context).Find("hand").rotation()
    np.testing.assert_allclose(R_TH.matrix() @ R_TH.matrix().T, np.eye(3), atol=1e-12)


def test_the_bus_follows_both_inputs(ports):
    bus = "desired_cartesian_poses"
    rig = ports(
        HandPoseBus("hand"),
        {bus: lambda value: value.Find("hand").GetAsMatrix34().tolist()},
    )
    changed = rig.changes(
        {"position": P, "orientation": Q}, {"position": [0.4, 0, 0], "orientation": [1, 0, 0, 0]}
    )
    assert changed == {("position", bus), ("orientation", bus)} == rig.feedthrough()
