"""Pepper alone, one arm free for teaching or correction, all other joints held."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import AffineSystem, MatrixGain

from pepper_drake.diagrams.station import add_gravity_compensation
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.pepper import BODY_JOINTS, JOINT_GROUPS, add_pepper, arm_group
from pepper_drake.systems.robot.robot_kinematics import RobotKinematics

LIMP = PdControllerGains(p=1e-6, d=0.2)
"""NAOqi's stiffness zero: no position control, what is left is the friction of the gears."""

_STIFF = PdControllerGains(p=400.0, d=20.0)
# Base and trunk carry what pulls at the arm without giving way.
_RIGID = PdControllerGains(p=4.0e4, d=2.0e3)


@dataclass(frozen=True)
class LonePepper:
    """What `add_lone_pepper` added.

    Attributes:
        plant: With Pepper and nothing else; gravity is compensated.
        scene_graph: Its geometry.
        pepper: The model instance.
        arm_target: Input (10): desired angles [rad], then rates [rad/s], of the arm's joints.
        joint_position: Output (15) [rad], in the order of `BODY_JOINTS`.
        arm_position: Output (5) [rad], shoulder to wrist.
        kinematics: Poses and positions of torso and hands, by the measured joints.
    """

    plant: MultibodyPlant
    scene_graph: SceneGraph
    pepper: ModelInstanceIndex
    arm_target: InputPort
    joint_position: OutputPort
    arm_position: OutputPort
    kinematics: RobotKinematics


def add_lone_pepper(
    builder: DiagramBuilder,
    arm: str,
    positions: Mapping[str, float],
    *,
    arm_gains: PdControllerGains,
    time_step: float = 0.002,
) -> LonePepper:
    """Adds Pepper, its base at the world's origin, and its measurements.

    Args:
        builder: Of the diagram.
        arm: The arm that is free, "left" or "right".
        positions: Where every joint starts [rad, m], by name; all but the arm's stay there.
        arm_gains: How firmly the arm's joints follow `arm_target`.
        time_step: The plant's step [s].
    """
    plant, scene_graph = AddMultibodyPlant(
        MultibodyPlantConfig(
            time_step=time_step,
            discrete_contact_approximation="sap",
            use_sampled_output_ports=False,
        ),
        builder,
    )
    pepper = add_pepper(plant)
    arm_joints = JOINT_GROUPS[arm_group(arm)]
    rigid_joints = (*JOINT_GROUPS["base"], *JOINT_GROUPS["body"])
    actuators = [plant.get_mutable_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    for actuator in actuators:
        name = actuator.joint().name()
        held = _RIGID if name in rigid_joints else _STIFF
        actuator.set_controller_gains(arm_gains if name in arm_joints else held)
        plant.GetJointByName(name).set_default_positions([positions[name]])
    plant.Finalize()

    count = len(actuators)
    names = [actuator.joint().name() for actuator in actuators]
    from_arm, held_state = np.zeros((2 * count, 10)), np.zeros(2 * count)
    for row, name in enumerate(names):
        if name in arm_joints:
            column = arm_joints.index(name)
            from_arm[row, column] = from_arm[count + row, 5 + column] = 1.0
        else:
            held_state[row] = positions[name]
    target = builder.AddNamedSystem("desired_state", AffineSystem(D=from_arm, y0=held_state))
    builder.Connect(target.get_output_port(), plant.get_desired_state_input_port(pepper))
    add_gravity_compensation(builder, plant)

    kinematics = builder.AddNamedSystem("kinematics", RobotKinematics(shared_control_model()))
    joints = _add_selector(builder, plant, "joint_position", BODY_JOINTS)
    base = _add_selector(builder, plant, "base_pose", JOINT_GROUPS["base"])
    builder.Connect(joints, kinematics.joint_position_input)
    builder.Connect(base, kinematics.base_pose_input)
    return LonePepper(
        plant=plant,
        scene_graph=scene_graph,
        pepper=pepper,
        arm_target=target.get_input_port(),
        joint_position=joints,
        arm_position=_add_selector(builder, plant, "arm_position", arm_joints),
        kinematics=kinematics,
    )


def _add_selector(
    builder: DiagramBuilder, plant: MultibodyPlant, name: str, joints: tuple[str, ...]
) -> OutputPort:
    """Adds what picks the positions of some joints out of the plant's state."""
    rows = [plant.GetJointByName(joint).position_start() for joint in joints]
    selector = builder.AddNamedSystem(
        name, MatrixGain(D=np.eye(plant.num_multibody_states())[rows])
    )
    builder.Connect(plant.get_state_output_port(), selector.get_input_port())
    return selector.get_output_port()
