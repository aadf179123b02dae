"""Perception with a robot: its head searches for the goal, then looks at the scene."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from pepper_drake.diagrams.head_perception import HeadPerception, PerceptionConfig
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.mailbox import CAMERA_NAMES
from pepper_drake.hardware.robot_run import HardwareRun, RobotRun
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.models.scene import Scene
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.systems.framework import build
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge

Vector = npt.NDArray[np.float64]

SEARCH = 14.0
"""Longest search for the goal [s]: two sweeps of the head."""
LOOK = 3.0
"""Time of looking at the scene once the goal is seen [s]."""


@dataclass(frozen=True, eq=False)
class RobotView:
    """Goal and obstacles as a robot saw them.

    Attributes:
        goal_positions: Of the goal object in the robot's world (N, 3), one per observation [m].
        cloud: Obstacles in the same frame (P, 3) [m].
        images: The newest of each camera: (H, W, 3) RGB, or (H, W) depths [mm].
        ages: Age of each image at the end [s].
        fault: Of the robot or the link, or None.
        is_stopped: Whether the user stopped it.
    """

    goal_positions: Vector
    cloud: Vector
    images: dict[str, npt.NDArray[np.generic]]
    ages: dict[str, float]
    fault: LinkFault | None
    is_stopped: bool


def look_with_robot(
    scene: Scene, run: HardwareRun, config: PerceptionConfig | None = None
) -> RobotView:
    """Lets a robot look; only its head moves.

    Args:
        scene: Defines the goal object and the side to look at.
        run: How the robot is driven.
        config: Of the perception.

    Raises:
        LinkFault: The robot cannot be reached, or is not ready; nothing was moved.
    """
    with RobotRun(run, scene.arm) as robot:
        builder = DiagramBuilder()
        station = builder.AddNamedSystem("station", robot.station())
        perception = builder.AddNamedSystem("perception", HeadPerception(scene, station, config))
        perception.connect(builder, station)
        groups = {"head": JOINT_GROUPS["head"]}
        commands = builder.AddNamedSystem("commands", JointCommandMerge(groups, robot.joints))
        rest = builder.AddNamedSystem("rest", ConstantVectorSource(np.zeros(3)))
        for source, target in (
            (perception.GetOutputPort("head_position_command"), commands.get_input_port()),
            (commands.get_output_port(), station.GetInputPort("joint_position_command")),
            (rest.get_output_port(), station.GetInputPort("base_velocity_command")),
        ):
            builder.Connect(source, target)
        diagram = build(builder)
        simulator = Simulator(diagram)
        root = simulator.get_context()
        inside = perception.GetMyContextFromRoot(root)
        goals: list[Vector] = []
        seen_since = np.inf
        last = -np.inf

        def is_over() -> bool:
            nonlocal seen_since, last
            now = root.get_time()
            if perception.GetOutputPort("goal_valid").Eval(inside)[0] > 0.5:
                seen_since = min(seen_since, now)
                if now - last >= 0.1:
                    X_WO = perception.GetOutputPort("object_pose").Eval(inside)
                    goals.append(np.array(X_WO.translation()))
                    last = now
            return now > min(SEARCH, seen_since) + LOOK

        robot.advance(diagram, is_over, simulator)
        cloud = cloud_points(perception.GetOutputPort("cloud").Eval(inside)).copy()
        images, ages = {}, {}
        at = station.GetMyContextFromRoot(root)
        for name in CAMERA_NAMES:
            stamp = float(station.GetOutputPort(f"{name}.time_stamp").Eval(at)[0])
            if np.isfinite(stamp):
                pixels = station.GetOutputPort(f"{name}.image").Eval(at).data
                color = pixels.shape[2] == 4
                images[name] = (pixels[..., :3] if color else pixels[..., 0]).copy()
                ages[name] = root.get_time() - stamp
    found = np.array(goals).reshape(-1, 3)
    return RobotView(found, cloud, images, ages, robot.fault, robot.is_stopped)
