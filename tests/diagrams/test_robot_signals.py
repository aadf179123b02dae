"""A station that is worn or fails, without a scene: fast, and seen from its ports alone."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.robot_calibration import JointCalibration, RobotCalibration
from pepper_drake.models.robot_wear import RobotWear, WearSizes
from pepper_drake.perception.mapping.dynamic_obstacles import ApproachParameters
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.systems.faults.fault import parse_faults
from pepper_drake.systems.faults.fault_set import FaultSet

START = {"LShoulderPitch": 1.4, "RShoulderPitch": 1.4}


class Rig:
    """A station whose right elbow yaws at 0.5 rad/s while its base drives ahead."""

    def __init__(self, wear=None, faults=(), base_velocity=(0.0, 0.0, 0.0), calibration=None):
        config = StationConfig(
            cameras=False,
            wear=wear,
            calibration=calibration,
            faults=FaultSet(parse_faults(faults), seed=1),
        )
        builder = DiagramBuilder()
        self.model = shared_control_model()
        self.station = builder.AddSystem(PepperStation(None, config, self.model))
        velocity = builder.AddSystem(ConstantVectorSource(base_velocity))
        builder.Connect(
            velocity.get_output_port(), self.station.GetInputPort("base_velocity_command")
        )
        builder.ExportInput(self.station.GetInputPort("joint_position_command"), "command")
        self.logs = {
            name: LogVectorOutput(self.station.GetOutputPort(name), builder, 0.02)
            for name in ("joint_position", "base_pose", "measurement_age", "missing_joint")
        }
        self.true = LogVectorOutput(self.station.GetOutputPort("ground_truth.state"), builder, 0.02)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)

    def run(self, duration, elbow_speed=0.5):
        context = self.simulator.get_mutable_context()
        plant = self.station.plant
        start = plant.GetPositions(plant.GetMyContextFromRoot(context))
        self.start = start[self.model.position_indices(BODY_JOINTS)]
        elbow = BODY_JOINTS.index("RElbowYaw")
        self.commands = []
        for tick in range(round(duration / 0.02)):
            command = self.start.copy()
            command[elbow] += elbow_speed * 0.02 * tick
            self.commands.append(command)
            self.diagram.GetInputPort("command").FixValue(context, command)
            self.simulator.AdvanceTo(0.02 * tick + 0.01)
        return self

    def rows(self, name):
        return self.logs[name].FindLog(self.simulator.get_context()).data().T

    def true_rows(self, joints):
        rows = self.true.FindLog(self.simulator.get_context()).data().T
        return rows[:, self.model.position_indices(joints)]


def test_an_ideal_robot_measures_what_is():
    rig = Rig().run(0.5)
    np.testing.assert_allclose(rig.rows("joint_position"), rig.true_rows(BODY_JOINTS), atol=1e-12)
    assert not rig.rows("measurement_age").any()
    assert (rig.rows("missing_joint") == -1).all()


def test_encoders_of_a_worn_robot_are_off_and_its_commands_arrive_late():
    wear = RobotWear.draw(3, WearSizes(backlash=0.0, command_latency=0.04))
    rig = Rig(wear).run(1.0)
    off = rig.rows("joint_position") - rig.true_rows(BODY_JOINTS)
    np.testing.assert_allclose(off, np.tile(wear.encoder_offset, (len(off), 1)), atol=1e-9)
    elbow = BODY_JOINTS.index("RElbowYaw")
    measured = rig.rows("joint_position")[-1, elbow]
    # Two periods of latency, one of the interpolator.
    late = np.array(rig.commands)[-1, elbow] - measured
    assert 0.5 * 0.04 < late < 0.5 * 0.09


def test_slack_is_between_motor_and_joint():
    wear = RobotWear.draw(3, WearSizes(encoder_offset=0.0, command_latency=0.0))
    rig = Rig(wear).run(1.0)
    elbow = BODY_JOINTS.index("RElbowYaw")
    ahead = rig.rows("joint_position")[:, elbow] - rig.true_rows(["RElbowYaw"])[:, 0]
    assert ahead[-1] == pytest.approx(np.radians(0.5), abs=1e-3)
    assert ahead[0] == pytest.approx(0.0, abs=1e-3)


def test_the_odometry_of_wheels_that_slip_is_off_by_a_share_of_the_way():
    wear = RobotWear.draw(3)
    rig = Rig(wear, base_velocity=(0.3, 0.0, 0.0)).run(2.0, elbow_speed=0.0)
    moved = rig.true_rows(JOINT_GROUPS["base"])[-1]
    measured = rig.rows("base_pose")[-1]
    assert moved[0] > 0.3
    assert measured[0] == pytest.approx((1 + wear.odometry[0]) * moved[0], abs=1e-9)


@pytest.mark.parametrize("kind", ["off", "garbage"])
def test_an_encoder_that_fails_is_named_and_what_is_measured_stays_a_number(kind):
    rig = Rig(faults=[f"encoders:{kind}@0.2"]).run(0.5)
    assert np.isfinite(rig.rows("joint_position")).all()
    assert np.abs(rig.rows("joint_position")).max() < 3.0
    age = rig.rows("measurement_age")[:, 0]
    assert not age[:10].any()
    assert age[-1] == pytest.approx(0.28, abs=0.05)
    missing = BODY_JOINTS[int(rig.rows("missing_joint")[-1, 0])]
    reach = (*JOINT_GROUPS["head"], *JOINT_GROUPS["right_arm"])
    assert kind == "off" or missing in reach


def test_odometry_that_fails_is_noticed():
    rig = Rig(faults=["base_pose:off@0.2+0.1"]).run(0.5)
    assert np.isfinite(rig.rows("base_pose")).all()
    age = rig.rows("measurement_age")[:, 1]
    assert 0.05 < age.max() < 0.15
    assert age[-1] == 0.0


def test_a_fault_that_waits_for_the_arm_has_a_port_for_it():
    assert Rig(faults=["encoders:off@reach"]).station.HasInputPort("fault_trigger")
    assert not Rig(faults=["encoders:off@1"]).station.HasInputPort("fault_trigger")


def test_a_calibrated_robot_measures_and_does_what_is_true():
    """Its encoders are off; what it says and what it is told is not."""
    wear = RobotWear.draw(3, WearSizes(backlash=0.0, odometry=0.0, command_latency=0.02))
    joints = {
        name: JointCalibration(offset=float(offset))
        for name, offset in zip(BODY_JOINTS, wear.encoder_offset, strict=True)
    }
    calibration = RobotCalibration(joints=joints)
    rig = Rig(wear, calibration=calibration).run(0.6, elbow_speed=0.0)
    np.testing.assert_allclose(rig.rows("joint_position"), rig.true_rows(BODY_JOINTS), atol=1e-9)
    np.testing.assert_allclose(rig.true_rows(BODY_JOINTS)[-1], rig.start, atol=1e-4)
    off = Rig(wear).run(0.6, elbow_speed=0.0)
    assert np.abs(off.true_rows(BODY_JOINTS)[-1] - off.start).max() > np.radians(0.3)


def test_images_of_a_worn_robot_are_compared_up_to_its_pointing_error():
    parameters = ObstacleParameters(approach=ApproachParameters(pointing_error=0.001))
    ideal, worn = (
        Rig(wear).station.obstacle_parameters(parameters).approach.pointing_error
        for wear in (None, RobotWear.draw(3))
    )
    assert (ideal, worn) == (0.001, 0.001 + WearSizes().pointing_error)
