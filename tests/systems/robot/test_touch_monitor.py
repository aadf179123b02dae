import numpy as np
import pytest
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.systems.robot.touch_monitor import TouchMonitor


@pytest.mark.parametrize("which", [0, 1])
def test_the_force_of_a_ball_at_rest_is_its_weight(which):
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.002)
    friction = CoulombFriction(0.9, 0.9)
    table = RigidTransform([0.0, 0.0, -0.05])
    plant.RegisterCollisionGeometry(plant.world_body(), table, Box(1, 1, 0.1), "table", friction)
    inertia = SpatialInertia.SolidSphereWithMass(2.0, 0.05)
    ball = plant.AddRigidBody("ball", inertia)
    plant.RegisterCollisionGeometry(ball, RigidTransform(), Sphere(0.05), "ball", friction)
    plant.Finalize()
    plant.SetDefaultFloatingBaseBodyPose(ball, RigidTransform([0.0, 0.0, 0.05]))
    goal = {plant.world_body().index()} if which else set()
    touch = builder.AddSystem(TouchMonitor(robot={ball.index()}, goal=goal))
    builder.Connect(plant.get_contact_results_output_port(), touch.contact_results_input)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.0)
    force = touch.get_output_port().Eval(touch.GetMyContextFromRoot(simulator.get_context()))
    assert force[which] == pytest.approx(2.0 * 9.81, rel=0.02)
    assert force[1 - which] == 0.0
    assert np.isfinite(force).all()
