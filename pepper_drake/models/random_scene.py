"""Random scenes: a table, the goal object and objects around it, drawn from one seed."""

import numpy as np

from pepper_drake.models.moving_obstacle import moving_obstacle
from pepper_drake.models.pepper import ARMS
from pepper_drake.models.scene import GoalObject, Obstacle, RobotStart, Scene

_TABLE_THICKNESS = 0.03
_WOOD = [0.72, 0.56, 0.38, 1.0]
_LEG_COLOR = [0.35, 0.33, 0.32, 1.0]
_GAP = 0.015
"""Smallest distance between the outlines of two objects on the table [m]."""
_GOAL_KEEP_OUT = 0.065
"""Radius of the goal object with its marker plate, seen from above [m]."""
_MAX_TRIES = 200


def random_scene(seed: int, *, moving: bool = False) -> Scene:
    """Returns the random scene of a seed; the same on every machine.

    It draws the arm, the table's height (0.66 to 0.80 m), edge and depth, the goal object's
    position and yaw, two to six objects that do not overlap, and the robot's start pose. Whether
    the goal can be reached is not checked.

    Args:
        seed: Seed of all random numbers.
        moving: Whether to add an obstacle that moves while the arm reaches.
    """
    rng = np.random.default_rng(seed)
    arm = str(rng.choice(ARMS))
    side = 1.0 if arm == "left" else -1.0
    height = float(rng.uniform(0.66, 0.80))
    edge = float(rng.uniform(0.75, 1.05))
    depth = float(rng.uniform(0.45, 0.65))
    goal = draw_goal(rng, edge, side, height)
    obstacles = table(edge, depth, height)
    obstacles += draw_things(rng, edge, depth, height, goal, most=6)
    scene = Scene(
        name=f"random_{seed}",
        description=f"The random scene of seed {seed}.",
        arm=arm,
        robot=draw_start(rng),
        goal=goal,
        obstacles=obstacles,
    )
    if moving:
        obstacle = moving_obstacle(scene, np.random.default_rng([seed, 1]))
        scene.obstacles.append(obstacle)
        scene.name = f"moving_{seed}"
        scene.description = f"The random scene of seed {seed}, with a {obstacle.name} that moves."
    scene.check()
    return scene


def draw_goal(
    rng: np.random.Generator,
    edge: float,
    side: float,
    height: float,
    behind_edge: tuple[float, float] = (0.05, 0.11),
) -> GoalObject:
    """Draws the goal object on a table.

    Args:
        rng: Random number generator.
        edge: Position of the table's edge along x [m].
        side: Side of the arm, 1 left or -1 right.
        height: Height of the table [m].
        behind_edge: Range of its distance behind the edge [m].
    """
    radius = round(float(rng.uniform(0.028, 0.036)), 4)
    goal = GoalObject(
        radius=radius,
        height=0.22,
        position=rounded(edge + rng.uniform(*behind_edge), side * rng.uniform(0.02, 0.20), height),
        yaw=round(float(rng.uniform(-0.3, 0.3)), 4),
    )
    # The plate touches the cylinder, whatever its radius.
    goal.marker.position[0] = round(-radius - 0.017, 4)
    return goal


def draw_start(rng: np.random.Generator) -> RobotStart:
    """Draws the robot's start pose: near the world's origin, facing about +x."""
    return RobotStart(
        x=round(float(rng.uniform(-0.1, 0.1)), 4),
        y=round(float(rng.uniform(-0.15, 0.15)), 4),
        yaw=round(float(rng.uniform(-0.2, 0.2)), 4),
    )


def draw_things(
    rng: np.random.Generator,
    edge: float,
    depth: float,
    height: float,
    goal: GoalObject,
    most: int,
) -> list[Obstacle]:
    """Draws two to `most` objects on a table around the goal object that do not overlap.

    Args:
        rng: Random number generator.
        edge: Position of the table's edge along x [m].
        depth: Depth of the table [m].
        height: Height of the table [m].
        goal: The goal object on the table.
        most: Largest number of objects.
    """
    things: list[Obstacle] = []
    taken = [(goal.position[0], goal.position[1], _GOAL_KEEP_OUT)]
    for number in range(int(rng.integers(2, most + 1))):
        thing, outline = _thing(rng, number)
        for _ in range(_MAX_TRIES):
            x = rng.uniform(edge + outline, edge + depth - outline)
            y = goal.position[1] + rng.uniform(-0.40, 0.40)
            if all(np.hypot(x - a, y - b) > outline + r + _GAP for a, b, r in taken):
                taken.append((x, y, outline))
                thing.position = rounded(x, y, height + thing.position[2])
                things.append(thing)
                break
    return things


def rounded(x: float, y: float, z: float) -> list[float]:
    """Rounds three lengths to a tenth of a millimetre."""
    return [round(float(value), 4) for value in (x, y, z)]


def table(edge: float, depth: float, height: float) -> list[Obstacle]:
    """Returns a table top and four legs, far enough apart for the robot's base to pass.

    Args:
        edge: Position along x of the edge facing the robot [m].
        depth: Size along x [m].
        height: Height of its upper surface [m].
    """
    width, leg = 1.4, 0.04
    underside = height - _TABLE_THICKNESS
    parts = [
        Obstacle(
            name="table_top",
            shape="box",
            size=rounded(depth, width, _TABLE_THICKNESS),
            position=rounded(edge + depth / 2, 0.0, height - _TABLE_THICKNESS / 2),
            color=list(_WOOD),
        )
    ]
    corners = [(x, y) for x in (edge + leg, edge + depth - leg) for y in (-0.64, 0.64)]
    for number, (x, y) in enumerate(corners, start=1):
        parts.append(
            Obstacle(
                name=f"table_leg_{number}",
                shape="box",
                size=rounded(leg, leg, underside),
                position=rounded(x, y, underside / 2),
                color=list(_LEG_COLOR),
            )
        )
    return parts


def _thing(rng: np.random.Generator, number: int) -> tuple[Obstacle, float]:
    """Draws an object standing at z = 0 (with x = y = 0), and its outline's radius."""
    kind = str(rng.choice(["mug", "bottle", "can", "box", "ball"]))
    name = f"{kind}_{number + 1}"
    color = [*(round(float(c), 3) for c in rng.uniform(0.15, 0.85, 3)), 1.0]
    yaw = round(float(rng.uniform(-np.pi, np.pi)), 4)
    if kind in ("mug", "bottle"):
        mesh = Obstacle(name=name, shape="mesh", mesh=f"{kind}.obj", size=[1.0], color=color)
        mesh.position, mesh.rpy = [0.0, 0.0, 0.0], [0.0, 0.0, yaw]
        return mesh, 0.07 if kind == "mug" else 0.037
    if kind == "can":
        radius, length = rounded(rng.uniform(0.025, 0.045), rng.uniform(0.08, 0.16), 0.0)[:2]
        can = Obstacle(name=name, shape="cylinder", size=[radius, length], color=color)
        can.position = [0.0, 0.0, length / 2]
        return can, radius
    if kind == "ball":
        radius = round(float(rng.uniform(0.025, 0.06)), 4)
        ball = Obstacle(name=name, shape="sphere", size=[radius], color=color)
        ball.position = [0.0, 0.0, radius]
        return ball, radius
    size = rounded(rng.uniform(0.04, 0.12), rng.uniform(0.06, 0.18), rng.uniform(0.05, 0.24))
    box = Obstacle(name=name, shape="box", size=size, color=color, rpy=[0.0, 0.0, yaw])
    box.position = [0.0, 0.0, size[2] / 2]
    return box, float(np.hypot(size[0], size[1]) / 2)
