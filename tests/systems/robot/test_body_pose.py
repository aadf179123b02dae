import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia

from pepper_drake.systems.robot.body_pose import BodyPose


def test_picks_the_pose_of_one_body_out_of_a_plants_port():
    plant = MultibodyPlant(0.0)
    plant.AddRigidBody("other", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    body = plant.AddRigidBody("body", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    plant.Finalize()
    plant_context = plant.CreateDefaultContext()
    X_WB = RigidTransform([0.1, 0.2, 0.3])
    plant.SetFreeBodyPose(plant_context, body, X_WB)
    system = BodyPose(body.index())
    context = system.CreateDefaultContext()
    poses = plant.get_body_poses_output_port().Eval(plant_context)
    system.body_poses_input.FixValue(context, poses)
    np.testing.assert_array_equal(
        system.pose_output.Eval(context).GetAsMatrix4(), X_WB.GetAsMatrix4()
    )
