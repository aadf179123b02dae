"""Pushing and guiding an arm, and the arm's compliance."""

from dataclasses import dataclass, field

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort, System

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.models.pepper import arm_group, hand_frame
from pepper_drake.systems.framework import connect
from pepper_drake.systems.guiding.external_force import ForcePulse, HandForce, ScriptedForce
from pepper_drake.systems.guiding.hand_guide import HandGuide, HandGuideParams


@dataclass
class ComplianceConfig:
    """Compliance of the arm while it is pushed."""

    stiffness: float = 0.05
    """Stiffness of the reaching arm, as in NAOqi: from 0, limp, to 1."""
    tracking: PhaseStopping = field(default_factory=PhaseStopping)
    """Phase stopping while the hand is pushed."""
    pushes: tuple[ForcePulse, ...] = ()
    """Pushes at the hand; time counts from when the arm starts."""


def add_hand_force(builder: DiagramBuilder, station: PepperStation, arm: str) -> HandForce:
    """Adds a system that applies a force at an arm's hand; its port `force` is left open."""
    frame = station.plant.GetFrameByName(hand_frame(arm))
    force = builder.AddNamedSystem("hand_force", HandForce(frame))
    connect(builder, force, station, spatial_forces="applied_forces")
    return force


def add_compliance(
    builder: DiagramBuilder,
    station: PepperStation,
    arm: str,
    compliance: ComplianceConfig,
    active: OutputPort,
) -> OutputPort:
    """Makes an arm compliant and adds scripted pushes at its hand; returns the push's port (6)."""
    station.set_stiffness(arm_group(arm), compliance.stiffness)
    force = add_hand_force(builder, station, arm)
    script = builder.AddNamedSystem("scripted_push", ScriptedForce(*compliance.pushes))
    builder.Connect(active, script.active_input)
    builder.Connect(script.push_output, force.force_input)
    return script.push_output


def add_hand_guide(
    builder: DiagramBuilder,
    robot: System,
    plant: MultibodyPlant,
    arm: str,
    params: HandGuideParams | None = None,
) -> HandGuide:
    """Adds a guide that pulls at an arm's hand; its other inputs are left open.

    Args:
        builder: Builder of the diagram that contains the robot.
        robot: A `PepperStation`, or a diagram with the same ports.
        plant: The robot's plant.
        arm: "left" or "right".
        params: Stiffness and damping of its grip.
    """
    frame = plant.GetFrameByName(hand_frame(arm))
    guide = builder.AddNamedSystem("hand_guide", HandGuide(frame, params))
    truth = {
        "ground_truth.body_poses": "body_poses",
        "ground_truth.body_velocities": "body_spatial_velocities",
    }
    connect(builder, robot, guide, **truth)
    connect(builder, guide, robot, spatial_forces="applied_forces")
    return guide
