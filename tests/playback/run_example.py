"""Runs as `apps/reach.py` leaves them, made by hand: the base stands, the arm lifts the hand."""

import json
from dataclasses import replace

import numpy as np

from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.models.scene import load_scene, save_scene
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.results.reach_log import ReachLog

BASE_POSE = (0.6, 0.02, 0.1)
GOAL_RISE = 0.08


def make_run(folder, *, lift=0.6, goal_rises=False, seconds=2.0):
    """A run of the scene "free": one second of looking, then RShoulderPitch goes up by `lift`."""
    times = np.arange(round(seconds * 100) + 1) * 0.01
    count = len(times)
    share = np.clip(times - 1.0, 0.0, 1.0)
    resting = load_scene("free").robot.positions()
    joints = np.tile([resting[name] for name in BODY_JOINTS], (count, 1))
    joints[:, BODY_JOINTS.index("RShoulderPitch")] -= lift * share
    offsets = np.zeros((count, 3 if goal_rises else 0))
    scene = load_scene("free")
    if goal_rises:
        offsets[:, 2] = GOAL_RISE * share
        path = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, GOAL_RISE]]
        scene = replace(scene, goal=replace(scene.goal, path=path))
    hand = np.array([0.2, -0.2, -0.2]) + share[:, None] * [0.1, 0.0, 0.2]
    log = ReachLog(
        time_s=times,
        mode=np.where(times < 1.0, ReachMode.LOOKING, ReachMode.REACHING).astype(np.int64),
        movement_origin=(times >= 1.0).astype(np.int64),
        joint_position_rad=joints,
        joint_command_rad=joints,
        base_pose_m_m_rad=np.tile(BASE_POSE, (count, 1)),
        object_offset_m=offsets,
        hand_position_torso_m=hand,
        desired_position_torso_m=hand,
        goal_position_torso_m=np.tile(hand[-1], (count, 1)),
        goal_distance_m=0.3 - 0.25 * share,
        orientation_error_rad=1.0 - 0.9 * share,
        axis_error_rad=0.5 - 0.4 * share,
        phase=np.exp(-5.0 * share),
        tau_s=np.ones(count),
        coupling_m_per_s2=np.zeros((count, 3)),
        clearance_m=np.full(count, 0.05),
        seen_clearance_m=np.full(count, 0.06),
        cloud_torso_m=np.array([[0.4, -0.1, 0.0], [0.5, -0.1, 0.0]]),
        demonstration_m=hand[::5],
        taught_path_torso_m=hand[::5],
        hand_opening=np.column_stack((np.full(count, 0.5), 1.0 - share)),
    )
    report = {
        "outcome": "reached",
        "reason": "",
        "scene": "free",
        "coupling": "barrier",
        "final_position_error": 0.0011,
        "minimum_clearance": 0.05,
        "tracking_error_rms": None,
    }
    folder.mkdir(parents=True)
    save_scene(scene, folder / "scene.yaml")
    log.save(folder / "log.npz")
    (folder / "report.json").write_text(json.dumps(report))
    return folder
