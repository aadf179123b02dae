"""Pepper, objects, markers and scenes, and the functions that add them to a plant."""

from pepper_drake.models.motion import goal_motion, load_path
from pepper_drake.models.objects import MovingObject, SceneModels, add_scene
from pepper_drake.models.pepper import (
    ARMS,
    JOINT_GROUPS,
    POSTURES,
    add_pepper,
    clamp_coupled_limits,
    elbow_roll_limits,
    hand_frame,
    head_pitch_limits,
)
from pepper_drake.models.random_scene import random_scene
from pepper_drake.models.scene import (
    SCENES,
    GoalObject,
    HandPose,
    Marker,
    Obstacle,
    RobotStart,
    Scene,
    load_scene,
    save_scene,
)

__all__ = [
    "ARMS",
    "JOINT_GROUPS",
    "POSTURES",
    "SCENES",
    "GoalObject",
    "HandPose",
    "Marker",
    "MovingObject",
    "Obstacle",
    "RobotStart",
    "Scene",
    "SceneModels",
    "add_pepper",
    "add_scene",
    "clamp_coupled_limits",
    "elbow_roll_limits",
    "goal_motion",
    "hand_frame",
    "head_pitch_limits",
    "load_path",
    "load_scene",
    "random_scene",
    "save_scene",
]
