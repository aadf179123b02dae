"""Adds a scene's obstacles and goal object to a MultibodyPlant."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    Box,
    Cylinder,
    GeometryInstance,
    Mesh,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.models.markers import marker_mesh, plate_size
from pepper_drake.models.motion import path_trajectory
from pepper_drake.models.pepper import hand_frame
from pepper_drake.models.scene import GoalObject, HandMarker, Marker, Obstacle, Scene
from pepper_drake.models.shapes import mesh_path
from pepper_drake.short_repr import short_repr

GOAL_OBJECT = "goal_object"
"""Name of the goal object's body, whose frame is O."""
SOLID = "solid"
"""Name of an obstacle's collision shape."""

_PLATE_THICKNESS = 0.003
_FRICTION = CoulombFriction(0.6, 0.5)
# Objects on a table touch it; friction must not impede those that move along a path.
_SLIPPERY = CoulombFriction(0.0, 0.0)
_MASS = 0.3
# Stiff enough to lag a path by at most one plant step, and not to be pushed away.
_GAINS = PdControllerGains(p=2.0e4, d=2.0e2)
_FLOOR_SIZE = 8.0
_FLOOR_COLOR = (0.74, 0.72, 0.69, 1.0)


@dataclass(frozen=True)
class MovingObject:
    """A body on three prismatic joints NAME_x, NAME_y, NAME_z along the world's axes.

    Their positions are its offset from its position in the scene.
    """

    name: str
    model: ModelInstanceIndex
    path: PiecewisePolynomial
    """The offset [m] over time [s]; its first derivative is part of the desired state, too."""


@dataclass(frozen=True)
class SceneModels:
    """Models that `add_scene` added to the plant."""

    obstacles: tuple[str, ...]
    """Body names of all obstacles, without the floor."""
    obstacle_models: tuple[ModelInstanceIndex, ...]
    """Model instances that contain only obstacles."""
    goal_object: str
    goal_model: ModelInstanceIndex | None
    moving: tuple[MovingObject, ...]
    """Models that need a desired state at `plant.get_desired_state_input_port(moving.model)`."""

    __repr__ = short_repr


NO_SCENE = SceneModels((), (), "", None, ())


def add_scene(plant: MultibodyPlant, scene: Scene) -> SceneModels:
    """Adds a scene's floor, obstacles and goal object to a plant that is not finalized yet.

    Objects with a path get stiff PD gains on three prismatic joints; the others are welded to the
    world. A marker on the hand has no collision shape.

    Args:
        plant: The plant with Pepper, registered with a scene graph.
        scene: A checked scene.
    """
    _add_floor(plant)
    still = plant.AddModelInstance("scene")
    models = {still}
    moving = []
    for obstacle in scene.obstacles:
        model = plant.AddModelInstance(obstacle.name) if obstacle.path else still
        models.add(model)
        body = plant.AddRigidBody(obstacle.name, model, _inertia())
        _register_obstacle(plant, body, obstacle)
        if obstacle.path:
            moving.append(_add_prismatic_joints(plant, body, obstacle.pose(), obstacle.path))
        else:
            plant.WeldFrames(plant.world_frame(), body.body_frame(), obstacle.pose())

    goal_model = plant.AddModelInstance(GOAL_OBJECT)
    goal_body = plant.AddRigidBody(GOAL_OBJECT, goal_model, _inertia())
    _register_goal(plant, goal_body, scene.goal)
    if scene.goal.path:
        moving.append(_add_prismatic_joints(plant, goal_body, scene.goal.pose(), scene.goal.path))
    else:
        plant.WeldFrames(plant.world_frame(), goal_body.body_frame(), scene.goal.pose())
    if scene.hand_marker is not None:
        hand = plant.GetFrameByName(hand_frame(scene.arm))
        _show_marker(plant, hand.body(), scene.hand_marker, hand.GetFixedPoseInBodyFrame())
    return SceneModels(
        obstacles=tuple(obstacle.name for obstacle in scene.obstacles),
        obstacle_models=tuple(sorted(models, key=int)),
        goal_object=GOAL_OBJECT,
        goal_model=goal_model,
        moving=tuple(moving),
    )


def _inertia() -> SpatialInertia:
    return SpatialInertia(
        mass=_MASS, p_PScm_E=np.zeros(3), G_SP_E=UnitInertia.SolidBox(0.1, 0.1, 0.1)
    )


def _add_floor(plant: MultibodyPlant) -> None:
    """Adds a slab with its top at z = 0, for cameras and meshcat, without collision shape."""
    X_WF = RigidTransform([0.0, 0.0, -0.01])
    floor = Box(_FLOOR_SIZE, _FLOOR_SIZE, 0.02)
    plant.RegisterVisualGeometry(plant.world_body(), X_WF, floor, "floor", _FLOOR_COLOR)


def _register_obstacle(plant: MultibodyPlant, body: RigidBody, obstacle: Obstacle) -> None:
    X = RigidTransform()
    friction = _SLIPPERY if obstacle.path else _FRICTION
    plant.RegisterCollisionGeometry(body, X, obstacle.solid(), SOLID, friction)
    if obstacle.shape == "mesh":
        visual: Shape = Mesh(mesh_path(obstacle.mesh), obstacle.size[0])
    else:
        visual = obstacle.solid()
    plant.RegisterVisualGeometry(body, X, visual, "visual", np.array(obstacle.color))


def _register_goal(plant: MultibodyPlant, body: RigidBody, goal: GoalObject) -> None:
    X_OC = RigidTransform([0.0, 0.0, goal.height / 2])
    cylinder = Cylinder(goal.radius, goal.height)
    friction = _SLIPPERY if goal.path else _FRICTION
    plant.RegisterCollisionGeometry(body, X_OC, cylinder, "cylinder", friction)
    plant.RegisterVisualGeometry(body, X_OC, cylinder, "cylinder", np.array(goal.color))

    plate, X_OP = _show_marker(plant, body, goal.marker, RigidTransform())
    plant.RegisterCollisionGeometry(body, X_OP, plate, "plate", friction)


def _show_marker(
    plant: MultibodyPlant, body: RigidBody, marker: Marker | HandMarker, X_BF: RigidTransform
) -> tuple[Box, RigidTransform]:
    """Adds the visual of a marker, posed in a body's frame F, on its plate; returns plate, X_BP."""
    X_BM = X_BF @ marker.pose()
    edge = plate_size(marker.size)
    # The plate's face lies slightly behind the marker's, to avoid z-fighting.
    X_BP = X_BM @ RigidTransform([0.0, 0.0, -0.0005 - _PLATE_THICKNESS / 2])
    plate = Box(edge, edge, _PLATE_THICKNESS)
    plant.RegisterVisualGeometry(body, X_BP, plate, "plate", np.ones(4))
    mesh = marker_mesh(marker.id, marker.size)
    plant.RegisterVisualGeometry(body, GeometryInstance(X_BM, mesh, "marker"))
    return plate, X_BP


def _add_prismatic_joints(
    plant: MultibodyPlant, body: RigidBody, X_WB: RigidTransform, path: Sequence[Sequence[float]]
) -> MovingObject:
    """Mounts a body on three actuated prismatic joints along the world's axes."""
    model, name = body.model_instance(), body.name()
    start = RigidTransform(X_WB.translation())
    parent = plant.AddFrame(FixedOffsetFrame(f"{name}_start", plant.world_frame(), start, model))
    # A frame of the body aligned with the world's axes, as the joints' axes are.
    X_BF = RigidTransform(X_WB.rotation().inverse())
    upright = plant.AddFrame(FixedOffsetFrame(f"{name}_upright", body.body_frame(), X_BF, model))
    for axis, direction in zip("xyz", np.eye(3), strict=True):
        if axis == "z":
            child = upright
        else:
            rail = plant.AddRigidBody(f"{name}_rail_{axis}", model, SpatialInertia.Zero())
            child = rail.body_frame()
        joint = plant.AddJoint(PrismaticJoint(f"{name}_{axis}", parent, child, direction))
        plant.AddJointActuator(f"{name}_{axis}", joint).set_controller_gains(_GAINS)
        parent = child
    return MovingObject(name=name, model=model, path=path_trajectory(path))
