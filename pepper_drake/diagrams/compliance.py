"""Compliance of an arm that is pushed, and the push itself."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.models.pepper import hand_frame
from pepper_drake.systems.guiding.external_force import ForcePulse, HandForce, ScriptedForce


@dataclass(frozen=True)
class ComplianceConfig:
    """Compliance of the arm during a reach."""

    stiffness: float = 0.05
    """Stiffness of the reaching arm, as NAOqi has it: from 0, limp, to 1."""
    tracking: PhaseStopping = field(default_factory=PhaseStopping)
    """Phase stopping while the hand is pushed."""
    pushes: tuple[ForcePulse, ...] = ()
    """Pushes at the hand, from when the arm starts."""


def add_hand_force(
    builder: DiagramBuilder, plant: MultibodyPlant, arm: str, applied_forces: InputPort
) -> HandForce:
    """Adds what applies a force at an arm's hand; its port `force` is left open."""
    force = builder.AddNamedSystem("hand_force", HandForce(plant.GetFrameByName(hand_frame(arm))))
    builder.Connect(force.spatial_forces_output, applied_forces)
    return force


def add_pushes(
    builder: DiagramBuilder, pushes: Sequence[ForcePulse], active: OutputPort, force: HandForce
) -> OutputPort:
    """Adds scripted pushes at a hand, from when the arm starts; returns the push (6)."""
    script = builder.AddNamedSystem("scripted_push", ScriptedForce(*pushes))
    builder.Connect(active, script.active_input)
    builder.Connect(script.push_output, force.force_input)
    return script.push_output
