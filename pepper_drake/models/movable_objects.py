"""Scenes whose objects can be moved while they are simulated."""

from collections.abc import Collection
from dataclasses import replace

from pepper_drake.errors import InputError
from pepper_drake.models.scene import Obstacle, Scene

_STAYS = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
"""A path of nowhere: it puts an object on rails, and a port moves it."""

_SPARES = (
    Obstacle("spare_ball", "sphere", [0.045], color=[0.20, 0.55, 0.35, 1.0]),
    Obstacle("spare_box", "box", [0.08, 0.08, 0.08], color=[0.55, 0.35, 0.65, 1.0]),
    Obstacle("spare_bottle", "cylinder", [0.035, 0.22], color=[0.25, 0.45, 0.70, 1.0]),
)
SPARES = tuple(spare.name for spare in _SPARES)
"""Names of the obstacles that `with_spare_obstacles` adds."""


def with_movable_objects(scene: Scene, names: Collection[str] = ()) -> Scene:
    """Returns the scene with the goal object and some obstacles on rails.

    Args:
        scene: As it is; what has a path in it can be moved in any case.
        names: Obstacles that can be moved besides.

    Raises:
        InputError: There is no obstacle of such a name.
    """
    known = [obstacle.name for obstacle in scene.obstacles]
    for name in names:
        if name not in known:
            raise InputError(
                f'there is no obstacle "{name}" in the scene; it has {", ".join(known) or "none"}'
            )
    obstacles = [
        replace(o, path=_STAYS) if o.path or o.name in names else o for o in scene.obstacles
    ]
    return replace(scene, goal=replace(scene.goal, path=_STAYS), obstacles=obstacles)


def with_spare_obstacles(scene: Scene) -> Scene:
    """Returns the scene with some obstacles more, on rails, out of sight below the floor.

    A plant takes no bodies once it is made: what a person adds to the scene comes from there.
    """
    taken = {obstacle.name for obstacle in scene.obstacles}
    spares = [
        replace(spare, position=[-1.0, 0.4 * index, -1.0], path=_STAYS)
        for index, spare in enumerate(_SPARES)
        if spare.name not in taken
    ]
    return replace(scene, obstacles=[*scene.obstacles, *spares])
