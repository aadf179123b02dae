"""A learned movement around an obstacle on a robot that is not Pepper: three axes and a tool.

The robot is built here with Drake; the movement, its phase and its obstacle coupling are systems of
pepper_drake. They work with any robot whose tool or joints follow position commands.

    python examples/cartesian_robot.py
"""

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import PdControllerGains, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantValueSource,
    ConstantVectorSource,
    LogVectorOutput,
    Multiplexer,
)

from pepper_drake.learning import BarrierCoupling, Demonstration, MovementPrimitive
from pepper_drake.perception.mapping.cloud_points import make_cloud
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems import CanonicalSystem, ObstacleCoupling, TransformationSystem

START, GOAL = (0.0, 0.0, 0.2), (0.4, 0.1, 0.3)
BALL, BALL_RADIUS, TOOL_RADIUS = (0.2, 0.05, 0.25), 0.05, 0.03  # [m]
TIME_STEP = 0.01  # [s]


@dataclass(frozen=True)
class Outcome:
    """Outcome of the movement: final error, and least distance of tool and ball [m]."""

    goal_error: float
    gap: float


def add_robot(plant: MultibodyPlant) -> None:
    """Adds a gantry with axes x, y, z; each follows its position command."""
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])  # Balanced.
    robot, parent = plant.AddModelInstance("robot"), plant.world_body()
    for name, axis in zip("xyz", np.eye(3), strict=True):
        inertia = SpatialInertia.SolidSphereWithMass(1.0, TOOL_RADIUS)
        body = plant.AddRigidBody(name, robot, inertia)
        joint = plant.AddJoint(PrismaticJoint(name, parent.body_frame(), body.body_frame(), axis))
        actuator = plant.AddJointActuator(name, joint)
        actuator.set_controller_gains(PdControllerGains(p=3e4, d=6e2))
        parent = body
    plant.Finalize()
    plant.SetDefaultPositions(robot, START)


def perform(*, avoid: bool, duration: float = 4.0) -> Outcome:
    """Learns a straight movement, and lets the robot perform it past the ball, or through it."""
    times = np.linspace(0.0, 2.0, 201)
    share = (times / 2.0) ** 3 * (10.0 - 15.0 * times / 2.0 + 6.0 * (times / 2.0) ** 2)
    taught = Demonstration.from_positions(times, np.outer(share, [0.3, 0.0, 0.0]))
    primitive = MovementPrimitive.fit(taught)
    law = BarrierCoupling(hand_radius=TOOL_RADIUS) if avoid else None
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    surface = np.array(BALL) + BALL_RADIUS * directions

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.001)
    add_robot(plant)
    phase = builder.AddSystem(CanonicalSystem(primitive, time_step=TIME_STEP))
    motion = builder.AddSystem(TransformationSystem(primitive, time_step=TIME_STEP))
    coupling = builder.AddSystem(ObstacleCoupling())
    movement = Value[object](Movement(primitive, coupling=law, id=1))
    constants = {
        "movement": builder.AddSystem(ConstantValueSource(movement)),
        "cloud": builder.AddSystem(ConstantValueSource(Value(make_cloud(surface)))),
        "start_position": builder.AddSystem(ConstantVectorSource(START)),
        "goal_position": builder.AddSystem(ConstantVectorSource(GOAL)),
    }
    outputs = {name: source.get_output_port() for name, source in constants.items()}
    for system in (phase, motion, coupling):
        outputs |= {
            p.get_name(): p for p in map(system.get_output_port, range(system.num_output_ports()))
        }
    for system in (phase, motion, coupling):  # Connects ports of the same name.
        for port in map(system.get_input_port, range(system.num_input_ports())):
            if port.get_name() in outputs:
                builder.Connect(outputs[port.get_name()], port)
    command = builder.AddSystem(Multiplexer([3, 3]))
    builder.Connect(motion.next_position_port, command.get_input_port(0))
    builder.Connect(motion.next_velocity_port, command.get_input_port(1))
    robot = plant.GetModelInstanceByName("robot")
    builder.Connect(command.get_output_port(), plant.get_desired_state_input_port(robot))
    log = LogVectorOutput(plant.get_state_output_port(robot), builder, TIME_STEP)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(duration)

    path = log.FindLog(simulator.get_context()).data()[:3].T
    gaps = np.linalg.norm(path - BALL, axis=1) - BALL_RADIUS - TOOL_RADIUS
    return Outcome(float(np.linalg.norm(path[-1] - GOAL)), float(gaps.min()))


if __name__ == "__main__":
    for avoid in (False, True):
        outcome = perform(avoid=avoid)
        print(
            f"{'with' if avoid else 'without'} the coupling: {1000 * outcome.goal_error:.1f} mm "
            f"from the goal, {1000 * outcome.gap:+.0f} mm between tool and ball"
        )
