"""Pepper alone: no scene, no cameras; one arm is commanded, the other joints and base are held."""

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from pepper_drake.diagrams.station import PepperStation, select_joints
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import arm_group
from pepper_drake.systems.framework import Diagram, connect
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge


def add_lone_pepper(
    builder: DiagramBuilder,
    arm: str,
    positions: Mapping[str, float],
    stiffness: float,
    robot: Diagram | None = None,
    config: StationConfig | None = None,
) -> tuple[PepperStation, JointCommandMerge, OutputPort]:
    """Adds the station, and the system that commands one arm and holds the rest.

    Args:
        builder: Builder of the diagram.
        arm: "left" or "right".
        positions: Start positions of all joints by name [rad, m].
        stiffness: Stiffness of that arm, as in NAOqi: from 0, limp, to 1. A limp arm takes no
            commands.
        robot: A real robot's station, already at `positions`; simulated if omitted.
        config: Configuration of the simulated robot, except for cameras and the arm's stiffness.

    Returns:
        The station; the system with the input `arm_command` (5) [rad], if the arm is not limp; and
        the arm's measured position (5) [rad].
    """
    config, joints = config or StationConfig(), arm_joints(arm)
    softened = config.stiffness | {arm_group(arm): stiffness}
    config = replace(config, cameras=False, stiffness=softened)
    chosen = robot or PepperStation(None, config, shared_control_model(), positions)
    station = cast(PepperStation, builder.AddNamedSystem("station", chosen))
    if robot is not None:
        base = builder.AddNamedSystem("base_stands", ConstantVectorSource(np.zeros(3)))
        builder.Connect(base.get_output_port(), station.GetInputPort("base_velocity_command"))
    commanded = {"arm": joints} if stiffness else {}
    commands = builder.AddNamedSystem("joint_commands", JointCommandMerge(commanded, positions))
    connect(builder, commands, station, "joint_position_command")
    measured = station.GetOutputPort("joint_position")
    return station, commands, select_joints(builder, measured, "arm_position", joints)
