"""Simulation of the physics alone, as the reference for the speed of the whole diagram.

The ratio of both speeds is valid on any machine if both run alternately in one process.
"""

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.diagrams.station import (
    PepperStation,
    add_gravity_compensation,
    plant_config,
)
from pepper_drake.models.objects import add_scene
from pepper_drake.models.pepper import add_pepper
from pepper_drake.models.scene import Scene


def make_physics(scene: Scene, like: PepperStation) -> Simulator:
    """Returns a simulator of a station's plant alone, with all motors holding their positions.

    Args:
        scene: The scene around the robot.
        like: The station whose time step and motor gains to use.
    """
    builder = DiagramBuilder()
    pair: tuple[MultibodyPlant, SceneGraph] = AddMultibodyPlant(
        plant_config(like.config.time_step), builder
    )
    plant, pepper = pair[0], add_pepper(pair[0])
    add_scene(plant, scene)
    for index in like.plant.GetJointActuatorIndices(like.pepper):
        theirs = like.plant.get_joint_actuator(index)
        mine = plant.GetJointActuatorByName(theirs.name(), pepper)
        plant.get_mutable_joint_actuator(mine.index()).set_controller_gains(
            theirs.get_controller_gains()
        )
    plant.Finalize()
    for name, position in scene.robot.positions().items():
        plant.GetJointByName(name, pepper).set_default_positions([position])
    add_gravity_compensation(builder, plant)
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    for number in range(plant.num_model_instances()):
        instance = ModelInstanceIndex(number)
        port = plant.get_desired_state_input_port(instance)
        if port.size():
            rows = plant.GetActuatedJointIndices(instance)
            held = [plant.get_joint(row).default_positions()[0] for row in rows]
            port.FixValue(context, np.concatenate((held, np.zeros(len(held)))))
    return simulator
