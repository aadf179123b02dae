import numpy as np
import pytest

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import hand_frame
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.collision.sphere_model import arm_link_names

MODEL = shared_control_model()
RIGHT = np.array(
    [[1.0, -0.4, 1.2, 0.9, 0.1], [0.2, -0.8, 0.5, 0.3, -0.7], [1.5, -0.1, 0.0, 0.1, 0]]
)


def posed(arm, joints):
    context = MODEL.create_context()
    for name, angle in zip(arm_joints(arm), joints, strict=True):
        MODEL.plant.GetJointByName(name).set_angle(context, angle)
    return context


@pytest.mark.parametrize("joints", RIGHT)
def test_the_hand_is_where_the_plant_has_it(joints):
    X_TH = arm_kinematics(MODEL, "right").hand_pose(joints)
    assert X_TH.IsNearlyEqualTo(
        MODEL.pose(posed("right", joints), hand_frame("right"), "torso"), 1e-12
    )


@pytest.mark.parametrize("joints", RIGHT)
def test_the_spheres_keep_the_scene_graphs_distance_within_14_mm(joints):
    kinematics = arm_kinematics(MODEL, "right")
    shapes = ExactDistance(MODEL, kinematics)
    root = MODEL.diagram.CreateDefaultContext()
    context = MODEL.plant.GetMyMutableContextFromRoot(root)
    for name, angle in zip(arm_joints("right"), joints, strict=True):
        MODEL.plant.GetJointByName(name).set_angle(context, angle)
    scene_graph = MODEL.diagram.scene_graph()
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
    links = [MODEL.plant.GetBodyByName(name) for name in arm_link_names("right")]
    own = {g for link in links for g in MODEL.plant.GetCollisionGeometriesForBody(link)}
    X_WT = MODEL.pose(context, "torso")
    p_TH = kinematics.hand_pose(joints).translation()
    points_T = p_TH + np.random.default_rng(0).uniform(-0.3, 0.3, (30, 3))
    for point in points_T:
        true = min(
            found.distance
            for found in query.ComputeSignedDistanceToPoint(X_WT @ point)
            if found.id_G in own
        )
        if true > 0.01:
            seen = shapes.distances(joints[None], PointCloudDistance(point[None], extension=0.0))[0]
            # Spheres leave out sharp corners and bulge out of flat sides, by 13.2 mm at most.
            assert seen == pytest.approx(true, abs=0.0135)


def test_the_left_arm_mirrors_the_right():
    mirrored = RIGHT * [1, -1, -1, -1, -1]
    right = arm_kinematics(MODEL, "right").hand_pose(RIGHT[0]).translation()
    left = arm_kinematics(MODEL, "left").hand_pose(mirrored[0]).translation()
    np.testing.assert_allclose(left, right * [1, -1, 1], atol=1e-9)


def test_many_postures_at_once_are_each_as_alone():
    shapes = ExactDistance(MODEL, arm_kinematics(MODEL, "right"))
    field = PointCloudDistance(np.array([[0.3, -0.2, 0.0], [0.2, -0.4, -0.2]]))
    together = shapes.distances(RIGHT, field)
    alone = [shapes.distances(joints[None], field)[0] for joints in RIGHT]
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-12)
