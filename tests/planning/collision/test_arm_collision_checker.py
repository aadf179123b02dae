import numpy as np
import pytest
from pydrake.geometry import Box, Cylinder, Role, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import arm_joints, body_indices, shared_control_model
from pepper_drake.models.pepper import head_pitch_limits
from pepper_drake.perception.mapping.solids import (
    Solid,
    SolidSet,
    collision_solids,
    sample_surface,
)
from pepper_drake.planning.collision.arm_collision_checker import (
    GRID_CAP,
    ArmCollisionChecker,
    BodyShapes,
    sample_body,
)
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance

MODEL = shared_control_model()
JOINTS = np.array(
    [[1.0, -0.4, 1.2, 0.9, 0.1], [0.7, -0.6, 1.0, 1.0, 0.6], [1.5, -0.15, 1.2, 0.5, 0.0]]
)
NOTHING = PointCloudDistance(np.zeros((0, 3)))


SHAPES = ExactDistance(MODEL, arm_kinematics(MODEL, "right"))


@pytest.fixture(scope="module")
def kinematics():
    return SHAPES.kinematics


def around(kinematics, field, *, X_FT=None, object_field=NOTHING, X_TO=None, body=None):
    body = SolidSet([]) if body is None else body
    layer = sample_body("right", body, 0.01)
    return ArmCollisionChecker(
        SHAPES,
        field,
        X_FT=RigidTransform() if X_FT is None else X_FT,
        goal_object=object_field,
        X_TO=RigidTransform() if X_TO is None else X_TO,
        body=lambda: SolidSet([]),
        head=SolidSet([]),
        body_layer=lambda: layer,
    )


def among_nothing(body, head=None, layer=None):
    """A checker of an arm that has only the robot's body around it."""
    return ArmCollisionChecker(
        SHAPES,
        NOTHING,
        X_FT=RigidTransform(),
        goal_object=NOTHING,
        X_TO=RigidTransform(),
        body=body,
        head=SolidSet([]) if head is None else head,
        body_layer=lambda: layer,
    )


def cloud(count=300, seed=0):
    lower, upper = [0.15, -0.5, -0.3], [0.5, 0.0, 0.2]
    return np.random.default_rng(seed).uniform(lower, upper, (count, 3))


def test_near_an_obstacle_clearances_are_those_of_the_shapes(kinematics, true_clearance):
    points = cloud(60)
    clearances = around(kinematics, PointCloudDistance(points, extension=0.0)).distances(JOINTS)
    checked = 0
    for joints, clearance in zip(JOINTS, clearances, strict=True):
        true = true_clearance("right", joints, points)
        if clearance < 0.03:
            assert clearance == pytest.approx(true, abs=1e-6)
            checked += 1
        else:
            assert clearance == pytest.approx(true, abs=0.0135)
    assert checked >= 1


def test_the_cloud_may_be_in_any_frame(kinematics):
    X_FT = RigidTransform(RollPitchYaw(0.1, -0.2, 0.8), [0.4, -0.3, 0.8])
    in_T = around(kinematics, PointCloudDistance(cloud(), extension=0.0))
    in_F = around(kinematics, PointCloudDistance((X_FT @ cloud().T).T, extension=0.0), X_FT=X_FT)
    np.testing.assert_allclose(in_F.distances(JOINTS), in_T.distances(JOINTS), atol=1e-9)
    np.testing.assert_allclose(
        in_F.approximate_distances(JOINTS), in_T.approximate_distances(JOINTS), atol=1e-4
    )


def test_what_is_far_is_infinitely_far(kinematics):
    far = around(kinematics, PointCloudDistance(np.array([[2.0, 0.0, 0.0]])))
    assert np.all(np.isinf(far.distances(JOINTS)))
    assert np.all(np.isinf(far.object_distances(JOINTS)))


def test_quick_gaps_are_those_of_the_spheres_within_a_centimetre(kinematics):
    field = PointCloudDistance(cloud(), extension=0.0)
    gaps = around(kinematics, field).approximate_distances(JOINTS)
    links = kinematics.spheres.link
    below = [k for k in range(len(links)) if kinematics.spheres.link_names[links[k]] != "RBicep"]
    centers = kinematics.sphere_centers_at(JOINTS)[:, below]
    exact = np.minimum(field.distance(centers), GRID_CAP) - kinematics.spheres.radii[below]
    np.testing.assert_allclose(gaps, exact, atol=0.012)
    assert np.abs(gaps - exact).mean() < 0.003


def test_postures_keep_a_distance_if_all_their_spheres_do(kinematics):
    checker = around(kinematics, PointCloudDistance(cloud(), extension=0.0))
    gaps = checker.approximate_distances(JOINTS)
    for least in np.quantile(gaps, [0.0, 0.02, 0.3], axis=0):
        kept = around(kinematics, PointCloudDistance(cloud(), extension=0.0)).keep_distances(
            JOINTS, least.astype(np.float32)
        )
        np.testing.assert_array_equal(kept, (gaps >= least.astype(np.float32)).all(axis=1))
    nearest = gaps.min(axis=0)
    assert checker.keep_distances(JOINTS, nearest).all()
    with pytest.raises(ValueError, match="finite"):
        checker.keep_distances(np.full((1, 5), np.nan), nearest)


def test_the_goal_object_is_apart_from_what_was_seen_and_in_the_grid(kinematics):
    hand = kinematics.hand_pose(JOINTS[0]).translation()
    alone = around(kinematics, NOTHING, object_field=PointCloudDistance(hand[None], extension=0.0))
    assert np.isinf(alone.distances(JOINTS[:1])[0])
    assert alone.object_distances(JOINTS[:1])[0] < 0.0
    assert alone.approximate_distances(JOINTS[:1]).min() < 0.0
    placed = around(
        kinematics,
        NOTHING,
        object_field=PointCloudDistance(np.zeros((1, 3)), extension=0.0),
        X_TO=RigidTransform(RollPitchYaw(0.3, 0.2, 0.1), hand),
    )
    np.testing.assert_allclose(
        placed.object_distances(JOINTS), alone.object_distances(JOINTS), atol=1e-12
    )


def test_only_forearm_and_hand_see_the_body(kinematics):
    hand = kinematics.hand_pose(JOINTS[0]).translation()
    body = SolidSet([Solid(Sphere(0.05), RigidTransform(hand))])
    gaps = around(kinematics, NOTHING, body=body).approximate_distances(JOINTS[:1])
    assert gaps.min() < 0.0
    elbow = SolidSet([Solid(Sphere(0.02), RigidTransform(elbow_of(kinematics)))])
    sphere = around(kinematics, NOTHING, body=elbow).approximate_distances(JOINTS[:1])
    first = kinematics.spheres.radii[np.flatnonzero(kinematics.spheres.link == 1)[0]]
    assert sphere[0, 0] == pytest.approx(GRID_CAP - first, abs=1e-6)


def elbow_of(kinematics):
    elbow = np.flatnonzero(kinematics.spheres.link == 1)[0]
    return kinematics.sphere_centers_at(JOINTS[:1])[0, elbow]


def test_with_a_cap_distances_to_solids_are_the_same_below_it():
    solids = SolidSet(
        [
            Solid(Box(0.2, 0.1, 0.3), RigidTransform(RollPitchYaw(0.3, 0.2, 0.1), [0.1, 0, 0])),
            Solid(Cylinder(0.05, 0.4), RigidTransform([-0.3, 0.1, 0.2])),
        ]
    )
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (4, 300, 3))
    np.testing.assert_allclose(
        solids.distance(points, cap=0.1), np.minimum(solids.distance(points), 0.1), atol=1e-12
    )


def test_surface_points_lie_on_the_surface_and_leave_no_hole():
    solids = [
        Solid(Cylinder(0.033, 0.22), RigidTransform([0, 0, 0.11])),
        Solid(Box(0.08, 0.08, 0.004), RigidTransform(RollPitchYaw(1.2, 0, 0.3), [-0.05, 0, 0.2])),
    ]
    for solid in solids:
        points = sample_surface([solid])
        p_S = (solid.X_FS.inverse() @ points.T).T
        np.testing.assert_allclose(solid.signed_distance(p_S), 0.0, atol=1e-9)
        outside = np.random.default_rng(0).uniform(-0.3, 0.4, (300, 3))
        true = solid.signed_distance((solid.X_FS.inverse() @ outside.T).T)
        seen = PointCloudDistance(points, extension=0.0).distance(outside)
        far = true > 0.01
        np.testing.assert_allclose(seen[far], true[far], atol=0.0035)
    with pytest.raises(TypeError, match="Sphere"):
        sample_surface([Solid(Sphere(0.1), RigidTransform())])


@pytest.mark.parametrize("part", ["body", "head"])
def test_self_distances_are_those_of_forearm_and_hand_to_the_body(part, true_clearance):
    for joints in JOINTS:
        ahead = SHAPES.kinematics.hand_pose(joints).translation() + [0.15, 0.0, 0.0]
        near, far = (Solid(Sphere(0.05), RigidTransform(p)) for p in (ahead, ahead + 9.0))
        body, head = (near, far) if part == "body" else (far, near)
        checker = among_nothing(lambda body=body: SolidSet([body]), SolidSet([head]))
        distance = checker.self_distances(joints[None])[0]
        truth = true_clearance("right", joints, ahead[None], cap=0.5) - 0.05
        assert 0.0 < truth - 1e-9 <= distance <= truth + 0.001
        assert checker.self_distances(joints[None], 0.5)[0] == pytest.approx(distance)
        assert 0.0 <= checker.self_distances(joints[None], 0.0)[0] <= distance


def test_self_distances_are_those_of_drake():
    body = BodyShapes(MODEL, "right")
    root = MODEL.diagram.CreateDefaultContext()
    context = MODEL.plant.GetMyMutableContextFromRoot(root)
    scene_graph = MODEL.diagram.scene_graph()
    inspector = scene_graph.model_inspector()
    moving = {f"R{name}" for name in ("Shoulder", "Bicep", "Elbow")} | {"Head", "r_wrist"}

    def geometries(keep):
        return [
            geometry
            for index in MODEL.plant.GetBodyIndices(MODEL.model_instance)
            if keep(MODEL.plant.get_body(index).name())
            for geometry in inspector.GetGeometries(
                MODEL.plant.GetBodyFrameIdOrThrow(index), Role.kProximity
            )
        ]

    arm = geometries(lambda name: name in ("RForeArm", "r_wrist"))
    others = geometries(lambda name: name not in moving | {"RForeArm"})
    rng = np.random.default_rng(0)
    limits = MODEL.command_limits(arm_joints("right"))
    joints, compared = np.zeros(15), 0
    joints[body_indices(["LShoulderPitch", "LShoulderRoll"])] = 1.4, 0.2
    checker = among_nothing(lambda: body.at(joints))
    for _ in range(300):
        q = rng.uniform(limits.position_lower, limits.position_upper)
        joints[body_indices(arm_joints("right"))] = q
        distance = checker.self_distances(q[None])[0]
        if not 0.0 < distance < 0.05:
            continue
        MODEL.plant.SetPositions(context, MODEL.positions(joints, np.zeros(3)))
        query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
        truth = min(
            query.ComputeSignedDistancePairClosestPoints(a, b).distance for a in arm for b in others
        )
        assert truth - 1e-5 <= distance <= max(truth, 0.0) + 0.0025
        compared += 1
    assert compared > 20


def test_the_body_is_the_robot_without_the_arm_and_its_shoulder():
    body = BodyShapes(MODEL, "right").at(np.zeros(15))
    torso = body.distance(np.zeros((1, 3)))[0]
    assert torso < 0.0
    shoulder_to_elbow = SHAPES.kinematics.poses(np.array([[0.0, -0.5, 0.0, 0.5, 0.0]]))
    elbow = shoulder_to_elbow.positions[0, 1]
    assert body.distance(elbow[None])[0] > 0.05


HEAD_AT_THE_SHOULDER = np.radians([-46.6, -26.9, 16.3, 62.9, 68.1])
"""A hand beside the head, which it touches if the head is turned by 34 degrees to it."""


def test_wherever_the_head_turns_it_is_where_a_plan_takes_it_to_be():
    swept = BodyShapes(MODEL, "right").head
    head = MODEL.plant.GetBodyByName("Head")
    own = collision_solids(MODEL.plant, MODEL.diagram.scene_graph(), head.index())
    rng = np.random.default_rng(0)
    context = MODEL.create_context()
    for _ in range(40):
        yaw = rng.uniform(-np.pi / 2, np.pi / 2)
        joints = np.zeros(15)
        joints[body_indices(["HeadYaw", "HeadPitch"])] = (
            yaw,
            rng.uniform(*head_pitch_limits(yaw)),
        )
        MODEL.plant.SetPositions(context, MODEL.positions(joints, np.zeros(3)))
        X_TH = MODEL.pose(context, "torso").inverse() @ MODEL.pose(context, "Head")
        away = rng.standard_normal((200, 3))
        surface = X_TH @ own[0].X_FS @ (0.112 * away.T / np.linalg.norm(away, axis=1))
        assert swept.distance(surface.T).max() < 0.003


def test_a_hand_beside_the_head_collides_whichever_way_it_is_turned():
    shapes = BodyShapes(MODEL, "right")
    for yaw in (-0.6, 0.0, 0.9):
        joints = np.zeros(15)
        joints[body_indices(["HeadYaw"])] = yaw
        layer = sample_body("right", shapes.head, 0.012)
        checker = among_nothing(lambda joints=joints: shapes.at(joints), shapes.head, layer)
        assert checker.self_distances(HEAD_AT_THE_SHOULDER[None])[0] < 0.0
        assert checker.approximate_distances(HEAD_AT_THE_SHOULDER[None]).min() < 0.0


def test_all_but_hip_and_leg_is_larger_by_the_margin():
    exact, larger = (BodyShapes(MODEL, "right", margin=m) for m in (0.0, 0.01))
    chest, leg = np.array([[0.3, 0.0, 0.0]]), np.array([[0.4, 0.0, -0.6]])
    for place, margin in ((chest, 0.01), (leg, 0.0)):
        near, nearer = (shapes.at(np.zeros(15)).distance(place)[0] for shapes in (exact, larger))
        assert near - nearer == pytest.approx(margin, rel=0.4, abs=1e-9)
    head = np.array([[0.4, 0.0, 0.3]])
    assert (exact.head.distance(head) - larger.head.distance(head))[0] == pytest.approx(0.01)
