"""Scenes whose objects can be moved during the simulation."""

from collections.abc import Collection
from dataclasses import replace

from pepper_drake.errors import InputError
from pepper_drake.models.scene import Obstacle, Scene

_ZERO_PATH = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
"""A path without motion: it gives an object prismatic joints, which a port then moves."""

_SPARES = (
    Obstacle("spare_ball", "sphere", [0.045], color=[0.20, 0.55, 0.35, 1.0]),
    Obstacle("spare_box", "box", [0.08, 0.08, 0.08], color=[0.55, 0.35, 0.65, 1.0]),
    Obstacle("spare_bottle", "cylinder", [0.035, 0.22], color=[0.25, 0.45, 0.70, 1.0]),
)
SPARES = tuple(spare.name for spare in _SPARES)
"""Names of the obstacles that `with_spare_obstacles` adds."""


def with_movable_objects(scene: Scene, names: Collection[str] = ()) -> Scene:
    """Returns the scene with the goal object and some obstacles movable.

    Args:
        scene: The scene; obstacles with a path become movable in any case.
        names: Further obstacles to make movable.

    Raises:
        InputError: The scene has no obstacle of that name.
    """
    known = [obstacle.name for obstacle in scene.obstacles]
    for name in names:
        if name not in known:
            raise InputError(
                f'there is no obstacle "{name}" in the scene; it has {", ".join(known) or "none"}'
            )
    obstacles = [
        replace(o, path=_ZERO_PATH) if o.path or o.name in names else o for o in scene.obstacles
    ]
    return replace(scene, goal=replace(scene.goal, path=_ZERO_PATH), obstacles=obstacles)


def with_spare_obstacles(scene: Scene) -> Scene:
    """Returns the scene with additional movable obstacles, hidden below the floor.

    Bodies cannot be added to a finalized plant: obstacles added by a person are taken from these.
    """
    taken = {obstacle.name for obstacle in scene.obstacles}
    spares = [
        replace(spare, position=[-1.0, 0.4 * index, -1.0], path=_ZERO_PATH)
        for index, spare in enumerate(_SPARES)
        if spare.name not in taken
    ]
    return replace(scene, obstacles=[*scene.obstacles, *spares])
