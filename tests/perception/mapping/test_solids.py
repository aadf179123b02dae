import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.point_cells import PointCells
from pepper_drake.models.control_model import ControlModel
from pepper_drake.models.pepper import POSTURES
from pepper_drake.perception.mapping.solids import (
    RobotSolids,
    Solid,
    SolidArrays,
    SolidSet,
    minimum_link_distances,
    near_solids,
)

SHAPES = [Box(0.1, 0.2, 0.3), Cylinder(0.1, 0.3), Sphere(0.15), Capsule(0.08, 0.2)]


def drakes_distances(shape, X_WS, points):
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("s")
    frame = scene_graph.RegisterFrame(source, GeometryFrame("f"))
    instance = GeometryInstance(RigidTransform(), shape, "g")
    instance.set_proximity_properties(ProximityProperties())
    scene_graph.RegisterGeometry(source, frame, instance)
    context = scene_graph.CreateDefaultContext()
    poses = FramePoseVector()
    poses.set_value(frame, X_WS)
    scene_graph.get_source_pose_port(source).FixValue(context, poses)
    query = scene_graph.get_query_output_port().Eval(context)
    return [query.ComputeSignedDistanceToPoint(p)[0].distance for p in points]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_distances_are_drakes(shape):
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.4, 0.4, (200, 3))
    expected = drakes_distances(shape, RigidTransform(), points)
    solid = Solid(shape, RigidTransform())
    np.testing.assert_allclose(solid.signed_distance(points), expected, atol=1e-9)
    corner = solid.bounding_radius
    assert np.all(np.linalg.norm(points[np.array(expected) <= 0], axis=1) <= corner)


@given(st.integers(0, 10_000), st.floats(-0.02, 0.1))
def test_near_is_closer_than_the_margin_to_any(seed, margin):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (80, 3))
    X_WF = RigidTransform(RollPitchYaw(rng.uniform(-3, 3, 3)), rng.uniform(-0.2, 0.2, 3))
    solids = [
        Solid(shape, RigidTransform(RollPitchYaw(rng.uniform(-3, 3, 3)), rng.uniform(-0.2, 0.2, 3)))
        for shape in SHAPES
    ]
    distances = np.min(
        [solid.signed_distance(((X_WF @ solid.X_FS).inverse() @ points.T).T) for solid in solids],
        axis=0,
    )
    near = near_solids(points, solids, [X_WF] * 4, margin)
    clear = np.abs(distances - margin) > 1e-9
    np.testing.assert_array_equal(near[clear], (distances <= margin)[clear])


def test_no_points_and_no_solids():
    assert near_solids(
        np.zeros((0, 3)), [Solid(SHAPES[0], RigidTransform())], [RigidTransform()], 0
    ).shape == (0,)
    assert not near_solids(np.zeros((2, 3)), [], [], 0.1).any()


def test_other_shapes_are_named():
    with pytest.raises(InputError, match="Ellipsoid"):
        Solid(Ellipsoid(1, 2, 3), RigidTransform())


def test_robot_is_where_its_joints_put_it():
    model = ControlModel()
    robot = RobotSolids(model.plant, model.diagram.scene_graph())
    q = np.zeros(robot.num_positions)
    for name, angle in POSTURES["stand"].items():
        q[model.plant.GetJointByName(name).position_start()] = angle
    q[model.plant.GetJointByName("BaseX").position_start()] = 0.4
    context = model.create_context()
    model.plant.SetPositions(context, q)
    hand = model.pose(context, "r_hand_effector").translation()
    points = np.array([hand, [0.4, 0.0, 0.85], [0.4, 0, 1.7], [0.9, 0, 0.8]])
    np.testing.assert_array_equal(robot.near(points, q, 0.03), [True, True, False, False])


@given(seed=st.integers(0, 10**6), kind=st.integers(0, 3))
@settings(max_examples=200)
def test_distances_of_links_are_those_of_their_solids(seed, kind):
    rng = np.random.default_rng(seed)
    shape = (Box(0.3, 0.04, 0.1), Cylinder(0.05, 0.4), Sphere(0.08), Capsule(0.03, 0.5))[kind]

    def pose():
        return RigidTransform(
            RollPitchYaw(rng.uniform(-3.0, 3.0, 3)).ToRotationMatrix(), rng.uniform(-0.2, 0.2, 3)
        )

    solids, links = [Solid(shape, pose()), Solid(Sphere(0.05), pose())], [pose(), pose()]
    points, most = rng.uniform(-0.6, 0.6, (rng.integers(20, 400), 3)), rng.choice([0.0, 0.1])
    found = minimum_link_distances(
        np.array([[X.rotation().matrix() for X in links]]),
        np.array([[X.translation() for X in links]]),
        np.array([1, 0]),
        SolidArrays.of(solids),
        PointCells.of(points),
        most,
    )
    exact = SolidSet.posed(solids, links[::-1]).distance(points, most).min()
    np.testing.assert_allclose(found, exact, atol=1e-12)
