"""Families of random scenes beyond a table with loose objects, each drawn from one seed."""

from collections.abc import Callable

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.models.moving_obstacle import moving_obstacle
from pepper_drake.models.pepper import ARMS
from pepper_drake.models.random_scene import (
    draw_goal,
    draw_start,
    draw_things,
    rounded,
    table,
)
from pepper_drake.models.scene import GoalObject, Obstacle, Scene

_HAND = 0.16
"""Space for the half-open hand beside the goal object's axis, with a margin [m]."""
_BOARD = [0.78, 0.72, 0.62, 1.0]
_PAINT = [0.32, 0.45, 0.55, 1.0]

Draw = Callable[[np.random.Generator, float], tuple[GoalObject, list[Obstacle]]]
"""Draws a family's goal and obstacles, given the arm's side: 1 left, -1 right."""


def family_scene(family: str, seed: int, *, moving: bool = False) -> Scene:
    """Returns a family's scene of a seed; the same on every machine.

    It draws the arm, the robot's start pose, and the family's objects. Whether the goal can be
    reached is not checked.

    Args:
        family: A name in FAMILIES.
        seed: Seed of all random numbers.
        moving: Whether to add an obstacle that moves while the arm reaches.

    Raises:
        InputError: The family is unknown, or has no room for a moving obstacle.
    """
    if family not in FAMILIES:
        raise InputError(f'family is "{family}"; it must be one of {", ".join(FAMILIES)}')
    if moving and family not in MOVING_FAMILIES:
        raise InputError(
            f"family {family} has no room for anything that moves; it must be one of "
            f"{', '.join(MOVING_FAMILIES)}"
        )
    rng = np.random.default_rng((seed, list(FAMILIES).index(family), 0xFA))
    arm = str(rng.choice(ARMS))
    robot = draw_start(rng)
    goal, obstacles = FAMILIES[family](rng, 1.0 if arm == "left" else -1.0)
    scene = Scene(
        name=f"{family}_{seed}",
        description=f"The scene of seed {seed} of the family {family}.",
        arm=arm,
        robot=robot,
        goal=goal,
        obstacles=obstacles,
    )
    if moving:
        obstacle = moving_obstacle(scene, np.random.default_rng([seed, 1]))
        scene.obstacles.append(obstacle)
        scene.name = f"moving_{scene.name}"
        scene.description = f"{scene.description[:-1]}, with a {obstacle.name} that moves."
    scene.check()
    return scene


def _box(
    name: str, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], color: list
) -> Obstacle:
    """Returns a box between two planes along each axis [m]."""
    sizes = [abs(b - a) for a, b in (x, y, z)]
    return Obstacle(
        name=name,
        shape="box",
        size=rounded(*sizes),
        position=rounded(*((a + b) / 2 for a, b in (x, y, z))),
        color=list(color),
    )


def _usual_table(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draws edge, depth and height of a table [m]."""
    edge, depth = float(rng.uniform(0.75, 1.0)), float(rng.uniform(0.5, 0.65))
    return edge, depth, float(rng.uniform(0.66, 0.80))


def _bin(rng: np.random.Generator, side: float) -> tuple[GoalObject, list[Obstacle]]:
    """Draws a goal in an open bin on a table; the hand enters from above."""
    edge, depth, height = _usual_table(rng)
    goal = draw_goal(rng, edge, side, height, (0.10, 0.14))
    x, y, _ = goal.position
    wall, top = 0.012, height + float(rng.uniform(0.06, 0.13))
    front, back = x - float(rng.uniform(0.075, 0.095)), x + float(rng.uniform(0.10, 0.18))
    near = y + side * (_HAND + float(rng.uniform(0.0, 0.08)))
    far = y - side * float(rng.uniform(0.07, 0.16))
    low, high = min(near, far), max(near, far)
    z = (height, top)
    obstacles = table(edge, depth, height)
    for name, spans in (
        ("front", ((front - wall, front), (low - wall, high + wall))),
        ("back", ((back, back + wall), (low - wall, high + wall))),
        ("right", ((front, back), (low - wall, low))),
        ("left", ((front, back), (high, high + wall))),
    ):
        obstacles.append(_box(f"bin_{name}", *spans, z, _PAINT))
    return goal, obstacles


def _compartment(rng: np.random.Generator, side: float) -> tuple[GoalObject, list[Obstacle]]:
    """Draws a goal in a compartment of a shelf: dividers, a back, and a board above."""
    edge, height = float(rng.uniform(0.78, 1.0)), float(rng.uniform(0.64, 0.76))
    goal = draw_goal(rng, edge, side, height, (0.06, 0.10))
    y, depth, board = goal.position[1], float(rng.uniform(0.28, 0.36)), 0.02
    above = height + float(rng.uniform(0.42, 0.50))
    near = y + side * (_HAND + float(rng.uniform(0.03, 0.12)))
    far = y - side * float(rng.uniform(0.09, 0.20))
    low, high = min(near, far), max(near, far)
    inside, over = (edge, edge + depth), (edge + 0.02, edge + depth)
    left, right = high + 0.4, low - 0.4
    obstacles = [
        _box("lower_board", inside, (right, left), (height - board, height), _BOARD),
        _box("upper_board", over, (right, left), (above, above + board), _BOARD),
        _box("back", (edge + depth, edge + depth + board), (right, left), (0.0, above), _BOARD),
        _box("right_divider", over, (low - board, low), (height, above), _BOARD),
        _box("left_divider", over, (high, high + board), (height, above), _BOARD),
        _box("right_side", inside, (right - board, right), (0.0, above), _BOARD),
        _box("left_side", inside, (left, left + board), (0.0, above), _BOARD),
    ]
    return goal, obstacles


def _pickets(rng: np.random.Generator, side: float) -> tuple[GoalObject, list[Obstacle]]:
    """Draws a goal surrounded by thin posts with gaps between them."""
    edge, depth, height = _usual_table(rng)
    goal = draw_goal(rng, edge, side, height)
    x, y, _ = goal.position
    obstacles = table(edge, depth, height)
    places: list[tuple[float, float]] = []
    for number in range(int(rng.integers(4, 8))):
        radius = round(float(rng.uniform(0.006, 0.014)), 4)
        length = round(float(rng.uniform(0.12, 0.35)), 4)
        for _ in range(100):
            px = x + float(rng.uniform(-0.08, 0.3))
            py = y + float(rng.uniform(-0.35, 0.35))
            beside = side * (py - y)
            in_hands_place = -0.06 < beside < _HAND and px < x + 0.14
            spread = all(np.hypot(px - a, py - b) > 0.07 for a, b in places)
            if edge + 0.02 < px < edge + depth - 0.02 and not in_hands_place and spread:
                places.append((px, py))
                post = Obstacle(name=f"picket_{number + 1}", shape="cylinder", color=list(_PAINT))
                post.size, post.position = [radius, length], rounded(px, py, height + length / 2)
                obstacles.append(post)
                break
    return goal, obstacles


def _side_panels(rng: np.random.Generator, side: float) -> tuple[GoalObject, list[Obstacle]]:
    """Draws a goal with a board on each side, along the hand's path."""
    edge, depth, height = _usual_table(rng)
    goal = draw_goal(rng, edge, side, height)
    x, y, _ = goal.position
    obstacles = table(edge, depth, height)
    for name, offset in (
        ("near", side * (_HAND + float(rng.uniform(0.01, 0.10)))),
        ("far", -side * float(rng.uniform(0.08, 0.18))),
    ):
        top = height + float(rng.uniform(0.15, 0.35))
        front = max(edge + 0.005, x - float(rng.uniform(0.02, 0.12)))
        panel = _box(
            f"{name}_panel",
            (front, front + float(rng.uniform(0.15, 0.30))),
            (y + offset, y + offset + np.sign(offset) * 0.015),
            (height, top),
            _BOARD,
        )
        obstacles.append(panel)
    return goal, obstacles


def _cupboard(rng: np.random.Generator, side: float) -> tuple[GoalObject, list[Obstacle]]:
    """Draws a goal with a tall cupboard beside the robot's place, on the arm's side."""
    edge, depth, height = _usual_table(rng)
    goal = draw_goal(rng, edge, side, height)
    obstacles = table(edge, depth, height)
    obstacles += draw_things(rng, edge, depth, height, goal, most=3)
    beside = goal.position[1] + side * float(rng.uniform(0.40, 0.60))
    front = edge - float(rng.uniform(0.02, 0.10))
    cupboard = _box(
        "cupboard",
        (front - float(rng.uniform(0.35, 0.50)), front),
        (beside, beside + side * 0.4),
        (0.0, float(rng.uniform(0.9, 1.5))),
        _BOARD,
    )
    return goal, [*obstacles, cupboard]


def _table_of(lowest: float, highest: float) -> Draw:
    """Returns a family of tables with objects, in a range of heights [m]."""

    def draw(rng: np.random.Generator, side: float) -> tuple[GoalObject, list[Obstacle]]:
        edge, depth, _ = _usual_table(rng)
        height = float(rng.uniform(lowest, highest))
        goal = draw_goal(rng, edge, side, height)
        things = draw_things(rng, edge, depth, height, goal, most=4)
        return goal, table(edge, depth, height) + things

    return draw


FAMILIES: dict[str, Draw] = {
    "bin": _bin,
    "compartment": _compartment,
    "pickets": _pickets,
    "side_panels": _side_panels,
    "cupboard": _cupboard,
    "low_table": _table_of(0.45, 0.62),
    "high_table": _table_of(0.82, 0.95),
}
"""The families by name."""

MOVING_FAMILIES = tuple(name for name in FAMILIES if name != "compartment")
"""Families with a table over which an obstacle can move."""
