"""What makes an arm give way when it is pushed, and the push itself."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder

from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.models.pepper import hand_frame
from pepper_drake.systems.guiding.external_force import ForcePulse, HandForce, ScriptedForce
from pepper_drake.systems.primitive.phase_stopping_coupling import PhaseStoppingCoupling


@dataclass(frozen=True)
class ComplianceConfig:
    """How an arm gives way during a reach."""

    stiffness: float = 0.05
    """Of the reaching arm, as NAOqi has it: from 0, limp, to 1."""
    tracking: PhaseStopping = field(default_factory=PhaseStopping)
    """How the movement waits for a hand that is pushed."""
    pushes: tuple[ForcePulse, ...] = ()
    """Pushes at the hand, from when the arm starts."""


def add_tracking(
    builder: DiagramBuilder,
    law: PhaseStopping,
    time_step: float,
    *,
    desired_position: OutputPort,
    measured_position: OutputPort,
) -> PhaseStoppingCoupling:
    """Adds what couples a movement to the hand's deviation; its port `active` is left open.

    Args:
        builder: Of the diagram.
        law: The constants.
        time_step: [s].
        desired_position: (3) of the hand in T [m].
        measured_position: (3) of the hand in T [m].
    """
    tracking = builder.AddNamedSystem("tracking_slowdown", PhaseStoppingCoupling(law, time_step))
    builder.Connect(desired_position, tracking.desired_position_input)
    builder.Connect(measured_position, tracking.measured_position_input)
    return tracking


def connect_couplings(
    builder: DiagramBuilder, acting: Sequence[System], canonical: System, translation: System
) -> dict[str, OutputPort]:
    """Hands on the sum of what slows a movement down and what bends it.

    Args:
        builder: Of the diagram.
        acting: Systems with the outputs `slowdown` (1) and `coupling` (3).
        canonical: With the input `slowdown`.
        translation: With the input `coupling`.

    Returns:
        The sums by name; none when nothing acts.
    """
    sums = {}
    for name, size, target in (("slowdown", 1, canonical), ("coupling", 3, translation)):
        sources = [system.GetOutputPort(name) for system in acting]
        if len(sources) > 1:
            adder = builder.AddNamedSystem(f"total_{name}", Adder(len(sources), size))
            for number, source in enumerate(sources):
                builder.Connect(source, adder.get_input_port(number))
            sources = [adder.get_output_port()]
        if sources:
            builder.Connect(sources[0], target.GetInputPort(name))
            sums[name] = sources[0]
    return sums


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
