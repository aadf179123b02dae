"""Distances of an arm to obstacles, to the goal object and to the rest of the robot."""

from collections.abc import Callable
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel, body_indices
from pepper_drake.models.pepper import BODY_JOINTS, head_pitch_limits
from pepper_drake.perception.mapping.solids import Solid, SolidArrays, SolidSet, collision_solids
from pepper_drake.planning.collision.clearance_table import FARTHEST
from pepper_drake.planning.collision.compiled_arm import placed_points
from pepper_drake.planning.collision.compiled_grid import Spheres, keep_distances
from pepper_drake.planning.collision.distance_grid import DistanceGrid, Region
from pepper_drake.planning.collision.exact_distance import ExactDistance, can_reach_body
from pepper_drake.planning.collision.sphere_model import SphereModel, arm_link_names

Vector = npt.NDArray[np.float64]

GRID_SPACING = 0.02
"""Spacing of the distance grid [m]."""
GRID_CAP = 0.08
"""Distances beyond this are all the same [m]: twice a sphere's radius."""

_HEAD_JOINTS = body_indices(["HeadYaw", "HeadPitch"])

CLOUD, CLOUD_AND_BODY = 0, 1
"""The grid's layers."""


def arm_region(arm: str) -> Region:
    """Region in T that forearm and hand can reach in front of and beside the robot."""
    side = 1.0 if arm == "left" else -1.0
    y = sorted((side * -0.22, side * 0.66))
    return Region.of([-0.20, y[0], -0.50], [0.50, y[1], 0.46], GRID_SPACING)


def self_collision_spheres(spheres: SphereModel) -> npt.NDArray[np.bool_]:
    """Which of an arm's spheres (S,) can reach the robot's body."""
    return np.array([can_reach_body(spheres.link_names[k]) for k in spheres.link])


_BESIDE_A_HANGING_ARM = ("Hip", "Pelvis", "Tibia")


class BodyShapes:
    """Pepper's collision shapes without those of one arm and its shoulder.

    An arm that hangs down is only millimetres from hip and leg. No arm has to be as near to the
    rest of the body, whose shapes are larger by a margin. The head turns while the arm moves, to
    places that a plan does not know: it has the shape of all its angles.

    Args:
        model: Pepper.
        arm: "left" or "right".
        margin: Added to all shapes but those of hip and leg [m].

    Attributes:
        head: The head's shapes, in T.
    """

    def __init__(self, model: ControlModel, arm: str, margin: float = 0.0) -> None:
        self._model = model
        self.head = swept_head(model, margin)
        left_out = {*arm_link_names(arm), f"{arm[0].upper()}Shoulder", "Head"}
        solids: list[Solid] = []
        self._frames = []
        for index in model.plant.GetBodyIndices(model.model_instance):
            body = model.plant.get_body(index)
            if body.name() in left_out:
                continue
            own = collision_solids(model.plant, model.diagram.scene_graph(), index)
            larger = 0.0 if body.name() in _BESIDE_A_HANGING_ARM else margin
            solids += [solid.grown(larger) for solid in own]
            self._frames += [body.body_frame()] * len(own)
        self._shapes = SolidArrays.of(solids)
        # The body's joints are the same for all that one answer, or a base placement, asks.
        self._recent = lru_cache(maxsize=4)(self._at)

    def at(self, joint_position: Vector) -> SolidSet:
        """Returns all shapes but the head's in T at joints (15,) in `BODY_JOINTS` order [rad]."""
        joints = np.array(joint_position, dtype=float)
        joints[_HEAD_JOINTS] = 0.0
        return self._recent(joints.tobytes())

    def _at(self, joints: bytes) -> SolidSet:
        context = self._model.create_context()
        q = self._model.positions(np.frombuffer(joints), np.zeros(3))
        self._model.plant.SetPositions(context, q)
        torso = self._model.plant.GetFrameByName("torso")
        poses = [frame.CalcPose(context, torso) for frame in self._frames]
        return SolidSet(self._shapes.posed(poses))


@lru_cache(maxsize=4)
def swept_head(model: ControlModel, margin: float) -> SolidSet:
    """Returns the head's shape at all its angles to the front, in T, made once.

    The head is a sphere with its centre at most 0.1 m from the joints: from one of the angles to
    the next it moves by at most 40 mm, between which the shapes lack 3 mm of what is swept.

    Args:
        model: Pepper.
        margin: By which it is larger [m].
    """
    plant, context = model.plant, model.create_context()
    head, torso = plant.GetBodyByName("Head"), plant.GetFrameByName("torso")
    own = collision_solids(plant, model.diagram.scene_graph(), head.index())
    swept = []
    for yaw in np.radians(range(-90, 91, 30)):
        for pitch in np.linspace(*head_pitch_limits(yaw), 5):
            joints = np.zeros(len(BODY_JOINTS))
            joints[_HEAD_JOINTS] = yaw, pitch
            plant.SetPositions(context, model.positions(joints, np.zeros(3)))
            X_TH = head.body_frame().CalcPose(context, torso)
            swept += [Solid(s.shape, X_TH @ s.X_FS).grown(margin) for s in own]
    return SolidSet(swept)


class ArmCollisionChecker:
    """Distances of an arm to everything that it must not touch.

    Args:
        shapes: Of the arm.
        obstacles: Seen obstacles, in any frame F.
        X_FT: The torso's pose in F.
        goal_object: The goal object's surface, in its frame O.
        X_TO: The goal object's pose.
        body: Gives the body's shapes in T.
        head: The head's.
        body_layer: Gives the body's layer (N,) of the grid [m]; see `sample_body`. Both are asked
            only when they are needed.

    Attributes:
        kinematics: Of the arm.
    """

    def __init__(
        self,
        shapes: ExactDistance,
        obstacles: PointCloudDistance,
        *,
        X_FT: RigidTransform,
        goal_object: PointCloudDistance,
        X_TO: RigidTransform,
        body: Callable[[], SolidSet],
        head: SolidSet,
        body_layer: Callable[[], npt.NDArray[np.float32]],
    ) -> None:
        self.kinematics, self._shapes = shapes.kinematics, shapes
        self._field, self._X_FT = obstacles, X_FT
        self._object, self._X_OT = goal_object, X_TO.inverse()
        self._body, self._head, self._body_layer = body, head, body_layer
        self._watched = self_collision_spheres(self.kinematics.spheres)

    def distances(self, joints: Vector) -> Vector:
        """Returns the least distance (N,) to seen obstacles at joints (N, 5) [rad] [m].

        It is exact where the arm is near, that of its spheres farther away, and infinite beyond
        `FARTHEST`.
        """
        return self._shapes.distances(joints, self._field, self._X_FT, within=FARTHEST)

    def object_distances(self, joints: Vector) -> Vector:
        """Returns the least distance (N,) to the goal object, as `distances` [m]."""
        return self._shapes.distances(joints, self._object, self._X_OT, within=FARTHEST)

    def self_distances(self, joints: Vector, within: float = np.inf) -> Vector:
        """Returns the least distance (N,) of forearm and hand to the robot's body [m].

        Args:
            joints: (N, 5) [rad].
            within: Distances are exact up to here [m]; greater ones may come out less, but not
                below this. With it, only postures near the body cost anything.
        """
        # The spheres enclose the arm: what they are not near to, the arm is not.
        radii = self.kinematics.spheres.radii[self._watched]
        spheres = self.kinematics.sphere_centers_at(joints)[:, self._watched]
        cap = within + float(radii.max())
        distances: Vector = (self._body_distance(spheres, cap) - radii).min(axis=1)
        near = np.flatnonzero(distances < within)
        if len(near):
            points = self._shapes.surface_points(joints[near])
            distances[near] = self._body_distance(points, within).min(axis=1)
        return distances

    def _body_distance(self, p_T: Vector, cap: float) -> Vector:
        """Returns distances (...) of points (..., 3) to body and head, at most `cap` [m]."""
        return np.minimum(self._body().distance(p_T, cap), self._head.distance(p_T, cap))

    @cached_property
    def grid(self) -> DistanceGrid:
        """Distances to all that the arm must not touch, without (0) and with (1) the body."""
        region = arm_region(self.kinematics.arm)
        body = self._body_layer()
        layers = np.stack((np.full_like(body, GRID_CAP), body))
        clouds = (self._field, self._X_FT), (self._object, self._X_OT)
        return DistanceGrid(region, layers, clouds, GRID_CAP)

    @cached_property
    def moving(self) -> Spheres:
        """Elbow, forearm and hand, with the grid's layer of each: the upper arm follows them."""
        spheres = self.kinematics.spheres
        kept = np.array([not spheres.link_names[k].endswith("Bicep") for k in spheres.link])
        layers = np.where(self._watched[kept], CLOUD_AND_BODY, CLOUD)
        radii = spheres.radii[kept].astype(np.float32)
        return Spheres(spheres.link[kept], spheres.centers[kept], radii, layers)

    def approximate_distances(self, joints: Vector) -> npt.NDArray[np.float32]:
        """Returns distances (N, S') of the spheres below the upper arm, from the grid [m].

        Within a few millimetres of the truth, and at most `GRID_CAP` less the sphere's radius;
        forearm and hand see the body, too, farther away than it is by its allowance.
        """
        spheres, poses = self.moving, self.kinematics.poses(joints)
        centers = placed_points(poses.rotations, poses.positions, spheres.link, spheres.centers)
        return np.asarray(self.grid.distance(centers, spheres.layers) - spheres.radii)

    def keep_distances(
        self, joints: Vector, least: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.bool_]:
        """Tells at which joints (N, 5) `approximate_distances` are all at least (S',) [m].

        Raises:
            ValueError: A joint is not finite.
        """
        if not np.isfinite(joints).all():
            raise ValueError("joints must be finite")
        arrays, chain = self.grid.arrays, self.kinematics.chain
        return keep_distances(joints, chain, self.moving, arrays, least)


@lru_cache(maxsize=2)
def _nodes(arm: str) -> Vector:
    return arm_region(arm).nodes()


def sample_body(arm: str, body: SolidSet, allowance: float) -> npt.NDArray[np.float32]:
    """Distance (N,) of the robot's body at the nodes of `arm_region`, at most `GRID_CAP` [m].

    Args:
        arm: "left" or "right".
        body: Its shapes in T.
        allowance: Added to the distance: by this the body may be nearer than obstacles [m].
    """
    distances = body.distance(_nodes(arm), cap=GRID_CAP) + allowance
    return np.minimum(distances, GRID_CAP).astype(np.float32)
