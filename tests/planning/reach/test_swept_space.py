from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.gaze.head_aiming import camera_pose
from pepper_drake.perception.mapping.dynamic_obstacles import DepthFrame
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.body_clearance import BodyClearance, body_links
from pepper_drake.planning.reach.separation import SeparationParams, StaleSpace, speed_fraction
from pepper_drake.planning.reach.swept_space import (
    UnseenSpaceParams,
    unseen_drive_space,
    unseen_sentence,
    unseen_space,
)

KINEMATICS = arm_kinematics(shared_control_model(), "right")
HOME, FORWARD = np.array([1.4, -0.2, 1.2, 0.6, 0.0]), np.array([0.2, -0.3, 1.0, 0.4, 0.0])
PATH = HOME + np.linspace(0.0, 1.0, 15)[:, None] * (FORWARD - HOME)
X_WT = RigidTransform(RotationMatrix.MakeZRotation(0.3), [1.0, -2.0, 0.82])
STRICT = UnseenSpaceParams(out_of_view_is_clear=False)
NOTHING_SEEN = SeenSpace(VoxelMap.empty())


class Seen:
    """All is seen but a box of T."""

    def __init__(self, lower, upper):
        self.lower, self.upper = np.array(lower), np.array(upper)

    def unseen(self, p_W, time, *, oldest):
        p_T = (p_W - X_WT.translation()) @ X_WT.rotation().matrix()
        return ((p_T > self.lower) & (p_T < self.upper)).all(axis=1)


def find(space, params=STRICT, path=PATH, time=1.0, movable=None):
    return unseen_space(KINEMATICS, path, X_WT, space, time, params, movable=movable)


def looked_through(heads, time=1.0):
    """Space seen by images of an empty room, taken with the head at angles."""
    camera = CAMERA_DEPTH.intrinsics
    depth = np.full((camera.height, camera.width), 3.0, np.float32)
    space = NOTHING_SEEN
    for head in heads:
        X_WC = X_WT @ camera_pose(CAMERA_DEPTH, head)
        space = space.with_view(DepthFrame(depth, X_WC, time, camera), space.voxels)
    return space


def test_of_a_movement_where_nothing_was_seen_all_but_where_the_arm_stands_is_unseen():
    region = find(NOTHING_SEEN).region
    swept = KINEMATICS.sphere_centers_at(PATH)
    p_T = (region - X_WT.translation()) @ X_WT.rotation().matrix()
    nearest = np.linalg.norm(p_T[:, None] - swept.reshape(-1, 3), axis=2).min(axis=1)
    np.testing.assert_allclose(nearest, 0.0, atol=1e-9)
    own = np.linalg.norm(p_T[:, None] - swept[0], axis=2) - KINEMATICS.spheres.radii
    assert own.min() > STRICT.own_margin - np.ptp(KINEMATICS.spheres.radii)
    assert len(region) > 100


def test_an_arm_that_stays_passes_nothing():
    assert len(find(NOTHING_SEEN, path=np.repeat(HOME[None], 5, axis=0)).region) == 0


def test_what_was_looked_through_is_known_and_what_is_out_of_view_is_reported():
    space = looked_through([(-0.3, 0.4), (-0.9, 0.4), (-0.6, 0.1)])
    unseen = find(space, UnseenSpaceParams())
    out_of_view = unseen.out_of_view
    assert unseen.regions == ()
    assert 1e-4 < out_of_view < 0.02
    assert len(find(space, STRICT).region) * STRICT.cell**3 == pytest.approx(out_of_view, rel=0.3)


def test_beside_what_may_move_space_out_of_view_is_not_clear_and_limits_the_pace():
    space, params = looked_through([(-0.3, 0.4), (-0.9, 0.4), (-0.6, 0.1)]), UnseenSpaceParams()
    hand = KINEMATICS.sphere_centers_at(PATH[len(PATH) // 2 :])[0, -1]
    thing = (X_WT @ (hand + [0.1, -0.1, 0.0]))[None]
    found = find(space, params, movable=thing)
    assert len(found.region) >= params.min_cells
    assert np.linalg.norm(found.region - thing, axis=1).max() < params.beside_movable
    soon = StaleSpace(time=params.stride * min(found.first), fastest=0.5)
    assert speed_fraction(soon, SeparationParams()) < 1.0
    far = thing + [0.0, 0.0, 2.0 * params.beside_movable]
    assert find(space, params, movable=far).regions == ()


def test_what_was_seen_too_long_ago_is_not_known():
    space = looked_through([(-0.3, 0.4), (-0.9, 0.4), (-0.6, 0.1)])
    params = UnseenSpaceParams()
    assert len(find(space, params, time=1.0 + 0.9 * params.max_age).region) == 0
    assert len(find(space, params, time=1.0 + 1.1 * params.max_age).region) > 0


def test_a_region_that_is_too_small_to_hold_anything_does_not_matter():
    box = Seen([0.1, -0.5, -0.2], [0.3, 0.0, 0.3])
    region = find(box).region
    assert len(region) >= STRICT.min_cells
    assert len(find(box, replace(STRICT, min_cells=len(region))).region) == len(region)
    assert len(find(box, replace(STRICT, min_cells=len(region) + 1)).region) == 0


def test_the_sentence_says_where_and_how_much():
    region = X_WT @ np.array([[0.3, -0.2, 0.1], [0.3, -0.2, 0.1]]).T
    sentence = unseen_sentence(region.T, X_WT, replace(STRICT, cell=0.1))
    assert "2.0 litres" in sentence
    assert "0.30 m ahead, 0.20 m to the right, 0.10 m above" in sentence


BODY = BodyClearance(shared_control_model(), body_links(shared_control_model()))
BASE, THERE = np.array([1.0, -2.0, 0.3]), np.array([1.5, -1.8, 0.3])


def find_drive(space, params=STRICT, goal=THERE, leaning=()):
    nothing = np.zeros((0, 3)), np.zeros(0)
    joints = np.zeros(15)
    return unseen_drive_space(BODY, BASE, goal, joints, X_WT, nothing, space, 1.0, params, leaning)


def test_all_that_the_body_sweeps_on_a_drive_is_unseen_but_the_floor_and_where_it_stands():
    region = find_drive(NOTHING_SEEN).region
    assert region[:, 2].min() > STRICT.floor
    # Farther on than the front of the base, which is 0.25 m from its middle, none is passed.
    ahead = (region[:, :2] - BASE[:2]) @ [np.cos(0.3), np.sin(0.3)]
    way = np.linalg.norm(THERE[:2] - BASE[:2])
    low = region[:, 2] < 0.3
    assert ahead[low].max() == pytest.approx(way + 0.25, abs=0.05)
    # The base of 0.5 m width sweeps an area of 0.5 m x the way at the height of its middle.
    layer = np.abs(region[:, 2] - 0.2) < 0.5 * STRICT.cell
    assert layer.sum() * STRICT.cell**2 == pytest.approx(0.5 * way, rel=0.25)
    X_WB = RigidTransform(RotationMatrix.MakeZRotation(BASE[2]), [*BASE[:2], 0.0])
    centers = (X_WB @ BODY.centers(np.zeros(15)).T).T
    off = np.linalg.norm(region[::20, None] - centers, axis=2) - BODY.radii
    assert off.min() > 0.0


def test_a_robot_that_stays_drives_through_nothing():
    assert find_drive(NOTHING_SEEN, goal=BASE).regions == ()


def test_where_it_leans_the_torso_and_head_sweep_space_too():
    leant = np.zeros(15)
    leant[BODY_JOINTS.index("HipPitch")] = -0.3
    region = find_drive(NOTHING_SEEN, goal=BASE, leaning=[leant]).region
    ahead = (region[:, :2] - BASE[:2]) @ [np.cos(BASE[2]), np.sin(BASE[2])]
    # Nothing below the hip, 0.75 m above the floor, and most at the height of the head.
    assert region[:, 2].min() > 0.7
    assert ahead[region[:, 2] > 1.0].max() > ahead[region[:, 2] < 0.9].max()
    assert 0.15 < ahead.max() < 0.4


def test_a_place_on_the_drive_that_was_not_seen_is_found():
    found = find_drive(Seen([0.3, -0.1, -0.75], [0.45, 0.1, -0.4])).region
    p_T = (found - X_WT.translation()) @ X_WT.rotation().matrix()
    np.testing.assert_allclose(p_T.mean(axis=0), [0.375, 0.0, -0.575], atol=0.03)
    assert find_drive(Seen([0.3, 0.5, -0.75], [0.45, 0.7, -0.4])).regions == ()


def test_what_is_smaller_than_a_bottle_does_not_keep_the_robot_from_driving():
    assert find_drive(Seen([0.3, -0.03, -0.6], [0.4, 0.03, -0.5])).regions == ()
