from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from scipy.optimize import brentq

from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import body_indices
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.gaze.head_aiming import camera_pose
from pepper_drake.perception.gaze.view_planning import head_grid
from pepper_drake.perception.mapping.dynamic_obstacles import DepthFrame
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.solids import Solid, sample_surface
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.planning.collision.arm_collision_checker import sample_body
from pepper_drake.planning.reach import planning_scene
from pepper_drake.planning.reach.planning_scene import PlanningSceneBuilder
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.reach.swept_space import UnseenSpaceParams
from tests.planning.reach.planner_setup import (
    MODEL,
    ORIGIN,
    STAND,
    make_planner,
    object_at,
    observed,
    sheet,
    stand,
)


@pytest.fixture(scope="module")
def room():
    """Space seen by images of an empty room, taken with the head turned to angles ahead."""
    camera, space = CAMERA_DEPTH.intrinsics, SeenSpace(VoxelMap.empty())
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(STAND, ORIGIN))
    X_WT, image = MODEL.pose(context, "torso"), np.full((camera.height, camera.width), 3.0)
    for head in head_grid()[np.abs(head_grid()[:, 0]) < 1.1]:
        X_WC = X_WT @ camera_pose(CAMERA_DEPTH, head)
        view = DepthFrame(image.astype(np.float32), X_WC, 0.0, camera)
        space = space.with_view(view, space.voxels)
    return space


@pytest.fixture(scope="module")
def watchful(right_primitive):
    """A planner that lets the base drive only where it was seen to be free."""
    return make_planner(right_primitive, make_coupling("barrier"))


def test_the_drive_to_a_place_is_clear_where_it_was_seen_to_be_free(watchful, room):
    observation = observed(ORIGIN, object_at())
    unseen = replace(observation, space=SeenSpace(VoxelMap.empty()))
    plan = watchful.plan_base_placement(unseen)
    assert plan.status == PlanStatus.NOT_SEEN
    assert plan.message.startswith("on its drive the robot would pass")
    assert "ahead" in plan.message
    ahead = plan.unseen[:, :2].mean(axis=0)
    assert 0.0 < ahead[0] < plan.base_pose[0] + 0.3
    assert watchful.check_drive(plan, unseen).status == PlanStatus.NOT_SEEN
    # Before the place is known, it looks along the way to a likely one.
    np.testing.assert_allclose(watchful.look_along_drive(unseen), plan.look_at, atol=0.1)
    empty = replace(observation, space=room)
    assert np.isnan(watchful.look_along_drive(empty)).all()
    seen = watchful.check_drive(plan, empty)
    assert (seen.status, seen.message, len(seen.unseen)) == (PlanStatus.CLEAR, "", 0)
    # Low and near there is much that no head angle shows, which is told.
    assert 0.05 < seen.out_of_view < 0.3
    way = 0.5 * plan.base_pose
    box = sheet((way[0] - 0.1, way[0] + 0.1), (way[1] - 0.1, way[1] + 0.1), 0.2)
    blocked = watchful.check_drive(plan, replace(observation, space=room, cloud=box))
    assert blocked.status == PlanStatus.NO_STANDING_ROOM


def test_a_drive_through_unseen_space_may_be_accepted(right_primitive):
    params = UnseenSpaceParams(allow_motion=True)
    planner = make_planner(right_primitive, make_coupling("barrier"), unseen=params)
    unseen = replace(observed(ORIGIN, object_at()), space=SeenSpace(VoxelMap.empty()))
    plan = planner.plan_base_placement(unseen)
    assert plan.status == PlanStatus.CLEAR
    assert len(plan.unseen) > 100


def test_a_lifted_goal_object_stands_on_nothing_where_space_was_seen_to_be_free(room):
    """Neither a disc is assumed below it, nor do sides of boxes at its height make a table."""
    height = 0.85
    sides = sheet(0.98, (-0.6, -0.2), (height - 0.02, height + 0.02), 0.01)
    builder = PlanningSceneBuilder(MODEL, "right", [], ReachPlannerParams())
    observation = observed(ORIGIN, object_at(z=height), sides)
    unknown = SeenSpace(VoxelMap.empty())
    fields = {
        space: builder.obstacle_field(replace(observation, space=space))
        for space in (room, unknown, None)
    }
    assert len(fields[room].points) == len(sides)
    beside = fields[None].points[len(sides) :]
    assert len(beside) > 0
    # Where nothing is known, both are assumed.
    assert len(fields[unknown].points) > len(sides) + len(beside)
    below = fields[unknown].distance(observation.p_WO[None])
    assert below[0] < 1e-6


def test_the_bodys_distances_stay_while_the_head_looks_around(monkeypatch):
    sampled = []
    monkeypatch.setattr(
        planning_scene,
        "sample_body",
        lambda arm, body, allowance: sampled.append(arm) or sample_body(arm, body, allowance),
    )
    builder = PlanningSceneBuilder(MODEL, "right", [], ReachPlannerParams())
    sampled.clear()
    for head, hip, count in ((0.0, 0.0, 1), (0.5, 0.0, 1), (-0.5, 0.2, 2)):
        joints = np.zeros(15)
        joints[body_indices(["HeadYaw"])] = head
        joints[body_indices(["HipPitch"])] = hip
        seen = replace(observed(ORIGIN, object_at()), joint_position=joints)
        assert builder(seen).checker.grid is not None
        assert len(sampled) == count


def test_what_is_hidden_below_a_thing_is_no_room_for_the_base(watchful, room):
    # Of a box on the floor, aside, its top shows alone, above the base.
    plan = stand(watchful, object_at())
    there = plan.base_pose + [0.0, 0.33, 0.0]
    top = sheet((there[0] - 0.1, there[0] + 0.1), (there[1] - 0.1, there[1] + 0.1), 0.5)
    seen = replace(observed(ORIGIN, object_at()), cloud=top)
    free, unknown = (replace(seen, space=s) for s in (room, SeenSpace(VoxelMap.empty())))
    assert watchful.check_drive(plan, free).status == PlanStatus.CLEAR
    assert watchful.check_drive(plan, unknown).status == PlanStatus.NO_STANDING_ROOM


def test_a_robot_that_stands_too_near_may_leave_but_comes_no_nearer(right_primitive):
    """A drive had to keep its clearance from its first place on: the robot was stuck there."""
    planner = make_planner(right_primitive, make_coupling("barrier"))
    wall = sheet((0.0, 0.01), (-0.6, 0.6), (0.05, 1.0), 0.02)
    post = sheet((0.0, 0.05), (0.55, 0.6), (0.05, 1.0), 0.02)

    def before_wall(x, *others):
        """The observation with the wall at x."""
        return observed(ORIGIN, object_at(), np.concatenate((wall + [x, 0.0, 0.0], *others)))

    def clearance(x):
        field = PointCloudDistance(before_wall(x).obstacles, extension=0.0)
        body = planner.base_placement.resting_clearances
        return float(body(ORIGIN[None], STAND, field, 1.0)[0])

    needed = planner.params.drive_clearance
    near = brentq(lambda x: clearance(x) - 0.5 * needed, 0.1, 0.6, xtol=1e-4)
    placement = stand(planner, object_at())
    away = replace(placement, base_pose=np.array([-0.1, 1.1, 0.0]))
    assert planner.check_drive(away, before_wall(near)).status == PlanStatus.CLEAR
    blocked = planner.check_drive(away, before_wall(near, post))
    assert blocked.status == PlanStatus.NO_STANDING_ROOM


def test_the_robot_does_not_stand_where_its_body_would_touch_the_goal_object(right_primitive):
    """Its tablet pressed against a marker that stood out towards it."""
    coupling = make_coupling("barrier")
    there = stand(make_planner(right_primitive, coupling), object_at()).base_pose
    p_OS = np.array([there[0] + 0.19, there[1], 0.8]) - object_at().translation()
    plate = Solid(Box(0.02, 0.1, 0.1), RigidTransform(p_OS))
    planner = make_planner(right_primitive, coupling, goal_solids=[plate])
    place = stand(planner, object_at()).base_pose
    field = PointCloudDistance((object_at() @ sample_surface([plate]).T).T, extension=0.0)
    body = planner.base_placement.body_clearances
    assert body(there[None], STAND, field, 1.0)[0] < 0.0
    assert body(place[None], STAND, field, 1.0)[0] >= planner.params.body_clearance
