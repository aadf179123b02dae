import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.systems.guiding.motion_recorder import MotionRecorder


def pose(time):
    # From rest to rest within 2 s.
    s = 0.5 * (1 - np.cos(np.pi * time / 2))
    return RigidTransform(RollPitchYaw(0.8 * s, -0.3 * s, 0.5 * s), [0.3 * s, -0.2, 0.1 * s])


class MovingHand(LeafSystem):
    def __init__(self):
        super().__init__()
        self.DeclareAbstractOutputPort(
            "pose",
            lambda: Value(RigidTransform()),
            lambda context, output: output.set_value(pose(context.get_time())),
            {self.time_ticket()},
        )


def test_record_is_the_motion_at_a_constant_step():
    builder = DiagramBuilder()
    hand = builder.AddSystem(MovingHand())
    joints = builder.AddSystem(
        TrajectorySource(PiecewisePolynomial.FirstOrderHold([0, 2], [[0.0, 1.0], [0.0, 0.0]]))
    )
    recorder = builder.AddSystem(MotionRecorder(["RElbowYaw", "RElbowRoll"]))
    builder.Connect(hand.get_output_port(), recorder.GetInputPort("hand_pose"))
    builder.Connect(joints.get_output_port(), recorder.GetInputPort("joint_position"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(2.0)
    demo = recorder.demonstration(simulator.get_context(), name="test")
    np.testing.assert_allclose(np.diff(demo.times), 0.01, atol=1e-9)
    assert len(demo.times) == 201
    assert demo.joint_names == ("RElbowYaw", "RElbowRoll")
    expected = [pose(t) for t in demo.times]
    np.testing.assert_allclose(demo.positions, [X.translation() for X in expected], atol=1e-4)
    for X, q in zip(expected, demo.rotations, strict=True):
        assert abs(X.rotation().ToQuaternion().wxyz() @ q) > 1 - 1e-7
    np.testing.assert_allclose(demo.joints[:, 0], demo.times / 2, atol=1e-3)
    # Peak velocity of the cosine: 0.3 m * pi / 4.
    np.testing.assert_allclose(demo.velocities[100, 0], 0.3 * np.pi / 4, rtol=1e-3)


def test_a_minute_is_6001_rows_at_a_step_constant_to_a_nanosecond():
    """The figure: 60 s at 100 Hz."""
    builder = DiagramBuilder()
    hand = builder.AddSystem(MovingHand())
    joints = builder.AddSystem(ConstantVectorSource([0.1]))
    recorder = builder.AddSystem(MotionRecorder(["RElbowYaw"]))
    builder.Connect(hand.get_output_port(), recorder.GetInputPort("hand_pose"))
    builder.Connect(joints.get_output_port(), recorder.GetInputPort("joint_position"))
    simulator = Simulator(builder.Build())
    for end in np.linspace(0.0, 60.0, 41)[1:]:  # As a recording is: slice by slice.
        simulator.AdvanceTo(end)
    times, samples = recorder.samples(simulator.get_context())
    assert samples.shape == (6001, 8)
    assert np.abs(np.diff(times) - 0.01).max() < 1e-9
    assert times[0] == 0.0
    assert times[-1] == 60.0
    demo = recorder.demonstration(simulator.get_context())
    np.testing.assert_array_equal(demo.times, times)
