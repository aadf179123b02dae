"""Perception of goal and obstacles by every camera, compared with the truth.

Pepper stands where the scene puts it and looks at the goal object. The obstacles are seen by the
depth camera and by a stereo pair, the marker on the goal object from all around by both colour
cameras. The output folder gets report.json, scenario.yaml, images.png, clouds.png, goal.png, and
clouds.html with the clouds beside the true surfaces (open it in a browser).

Or what Pepper's perception makes of your own data:

  perceive.py --image FILE --camera FILE --marker ID --size M    where a marker is in a photo
  perceive.py --depth FILE --camera FILE [--scale M]             the cloud of a depth image
  perceive.py --cloud FILE [--scale M]                           a cloud: PCD, PLY, NPZ or NPY

Or what a robot sees, searching the goal with its head; nothing else of it moves:

  perceive.py --station naoqi --robot tcp://192.168.1.10:9559     a real Pepper, or a served one

A camera file is ROS camera_info YAML, an OpenCV FileStorage, or NAOqi's camera and resolution.
"""

import dataclasses
import functools
import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.cli_scenario import add_scenario_options, check_robot_takes, scenario_of
from pepper_drake.cli_scene import add_scene_options, chosen_scene
from pepper_drake.errors import InputError
from pepper_drake.evaluation.marker_false_positives import count_false_positives
from pepper_drake.evaluation.own_data import report_cloud, report_depth, report_photo
from pepper_drake.evaluation.perception_evaluation import (
    CloudStudy,
    GoalSample,
    PerceptionEvaluation,
)
from pepper_drake.hardware.options import add_link_options, add_robot_address, check_station
from pepper_drake.hardware.perceive_run import look_with_robot
from pepper_drake.hardware.run_options import hardware_run
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP
from pepper_drake.perception.cameras.camera_files import load_intrinsics
from pepper_drake.perception.cameras.image_files import write_image
from pepper_drake.perception.goal.marker import MARKER_DICTIONARY
from pepper_drake.reporting.perception_figures import (
    draw_clouds,
    save_clouds_figure,
    save_goal_figure,
    save_images_figure,
)
from pepper_drake.results.folder import whole_results
from pepper_drake.scenario import Scenario, save_scenario
from pepper_drake.web.drake_page import open_meshcat

RESULTS = (
    "report.json",
    "images.png",
    "clouds.png",
    "goal.png",
    "clouds.html",
    "scenario.yaml",
    "cloud.npy",
    "camera_top.png",
    "camera_bottom.png",
    "camera_depth.png",
)
"""Output files of a run."""

OWN_RESULTS = ("report.json", "image.png", "cloud.npz", "cloud.html")
"""Output files for the user's own data."""

SIMULATED_ONLY: dict[str, object] = {
    "image": None,
    "depth": None,
    "cloud": None,
    "live": False,
}
"""Options for the simulation only, and their defaults."""

_DISTANCES = (0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2)
"""Distances of the camera from the marker [m]."""


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("perceive", __doc__, seed_of_scenario=True)
    add_scene_options(parser)
    add_scenario_options(parser, ("seed", "scene", "station", "perception"))
    parser.add_argument(
        "--texture",
        choices=("painted", "pattern", "none"),
        default="painted",
        help="what the stereo pair matches: a texture painted on all surfaces, a pattern that a "
        "projector throws on them, or the bare surfaces (default: %(default)s)",
    )
    parser.add_argument(
        "--frames", type=int, default=5, help="depth images to look at (default: %(default)s)"
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=10,
        help="looks at the marker from each distance with each camera (default: %(default)s)",
    )
    parser.add_argument(
        "--poses",
        type=int,
        default=10,
        help="poses of arms, head and base in which to look for points of Pepper's own body and of "
        "the goal object (default: %(default)s)",
    )
    parser.add_argument(
        "--wrong-goal-frames",
        type=int,
        default=200,
        metavar="N",
        help="images without the goal's marker, with others, or with half of it, in which to look "
        "for wrong goals (default: %(default)s)",
    )
    own = parser.add_argument_group("your own data")
    source = own.add_mutually_exclusive_group()
    source.add_argument("--image", type=Path, metavar="FILE", help="a photo with a marker")
    source.add_argument("--depth", type=Path, metavar="FILE", help="a depth image")
    source.add_argument("--cloud", type=Path, metavar="FILE", help="a point cloud")
    own.add_argument("--camera", type=Path, metavar="FILE", help="the camera that took it")
    own.add_argument("--marker", type=int, metavar="ID", help="the marker's number")
    own.add_argument("--size", type=float, metavar="M", help="side of the marker's black square, m")
    own.add_argument(
        "--dictionary",
        default=MARKER_DICTIONARY,
        metavar="NAME",
        help="OpenCV's dictionary that the marker is of (default: %(default)s)",
    )
    own.add_argument(
        "--scale",
        type=float,
        metavar="M",
        help="length of the unit of a depth image or cloud, m (default: whole numbers are "
        "millimetres, others metres)",
    )
    parser.add_argument(
        "--live", action="store_true", help="show the clouds in a browser, and stay open"
    )
    cli.add_host_option(parser)
    add_robot_address(parser)
    add_link_options(parser)
    return parser


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    if check_station(options, SIMULATED_ONLY):
        return _perceive_with_robot(options)
    if options.image or options.depth or options.cloud:
        return _perceive_own(options)
    for name in ("camera", "marker", "size", "scale"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name} belongs to --image, --depth or --cloud; give one of them.")
    if min(options.frames, options.samples) < 1:
        raise InputError("--frames and --samples must be at least 1.")
    if min(options.poses, options.wrong_goal_frames) < 0:
        raise InputError("--poses and --wrong-goal-frames must not be negative.")
    cli.quiet_libraries()
    # The times in the report are those of one core.
    cv2.setNumThreads(1)
    scenario = chosen_scenario(options)
    study = PerceptionEvaluation(scenario.scene, scenario.seed, scenario.reaching_config())
    clouds = {"depth": study.depth(options.frames), "stereo": study.stereo(options.texture)}
    robot_points, goal_points = study.foreign_points(options.poses)
    samples = _look_at_marker(study, options)
    wrong_goals = count_false_positives(study, options.wrong_goal_frames, scenario.seed)

    report = make_report(clouds, samples)
    report["depth"]["over_poses"] = {
        "poses": options.poses,
        "robot_points": robot_points,
        "goal_points": goal_points,
    }
    report["goal"]["wrong_goals"] = dataclasses.asdict(wrong_goals)
    report |= {
        "scene": scenario.scene.name,
        "seed": scenario.seed,
        "texture": options.texture,
    }
    with open_meshcat(page=options.live, host=options.host) as (meshcat, page):
        draw_clouds(meshcat, clouds)
        with whole_results(options.output, RESULTS) as folder:
            (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
            save_scenario(scenario, folder / "scenario.yaml")
            save_images_figure(clouds, folder)
            save_clouds_figure(clouds, folder)
            save_goal_figure(samples, folder)
            (folder / "clouds.html").write_text(meshcat.StaticHtml())
        if not options.quiet:
            print(summary(report))
            print(f"Results are in {options.output}")
        if page is not None:
            cli.wait_for_interrupt(f"Open {page.url} in a browser; Ctrl-C ends it.")
    return cli.EXIT_DONE


def chosen_scenario(options: Namespace) -> Scenario:
    """Returns the scenario of the options."""
    scenario = scenario_of(options)
    scenario.scene = chosen_scene(options, scenario.scene)
    if options.seed is not None:
        scenario.seed = options.seed
    return scenario


def _perceive_with_robot(options: Namespace) -> int:
    """Perceives goal and obstacles with the cameras of a robot."""
    cli.quiet_libraries()
    scenario = chosen_scenario(options)
    check_robot_takes(scenario, "station")
    with cli.stop_on_interrupt() as should_stop:
        run = hardware_run(options, should_stop)
        view = look_with_robot(scenario.scene, run, scenario.perception)
    report: dict = {
        "address": options.robot,
        "goal_position": None,
        "goal_spread": None,
        "goal_samples": len(view.goal_positions),
        "cloud_points": len(view.cloud),
        "image_ages": view.ages,
        "fault": view.fault.word if view.fault else "",
    }
    if len(view.goal_positions):
        report["goal_position"] = np.median(view.goal_positions, axis=0).tolist()
        report["goal_spread"] = float(np.linalg.norm(view.goal_positions.std(axis=0)))
    with whole_results(options.output, RESULTS) as folder:
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
        save_scenario(scenario, folder / "scenario.yaml")
        np.save(folder / "cloud.npy", view.cloud)
        for name, pixels in view.images.items():
            bgr = pixels[..., ::-1] if pixels.ndim == 3 else pixels
            write_image(folder / f"{name}.png", bgr)
    if not options.quiet:
        if report["goal_position"]:
            x, y, z = report["goal_position"]
            spread = 1000 * report["goal_spread"]
            print(
                f"  goal    at ({x:.3f}, {y:.3f}, {z:.3f}) m, within {spread:.1f} mm in "
                f"{len(view.goal_positions)} looks"
            )
        else:
            print("  goal    not seen")
        print(f"  cloud   {len(view.cloud)} points")
        print(f"Results are in {options.output}")
    if view.is_stopped:
        return cli.EXIT_INTERRUPTED
    return cli.EXIT_DONE if report["goal_position"] and not view.fault else cli.EXIT_FAILED


def _perceive_own(options: Namespace) -> int:
    """Processes the user's own photo, depth image or cloud."""
    if options.scenario is not None or options.set:
        raise InputError("--scenario, --set: are not for your own data; leave them out")
    if options.scale is not None and not options.scale > 0:
        raise InputError(f"--scale {options.scale:g} must be positive.")
    if options.cloud:
        read = functools.partial(report_cloud, options.cloud, scale=options.scale or 1.0)
    else:
        if options.camera is None:
            raise InputError("--camera is needed: a file with the intrinsics of the camera.")
        camera = load_intrinsics(options.camera)
        if options.depth:
            read = functools.partial(report_depth, options.depth, camera, scale=options.scale)
        elif options.marker is None or options.size is None:
            raise InputError("--marker and --size are needed to find a marker in an image.")
        else:
            read = functools.partial(
                report_photo,
                options.image,
                camera,
                options.marker,
                options.size,
                dictionary=options.dictionary,
            )
    with whole_results(options.output, OWN_RESULTS) as folder:
        report, words = read(folder=folder)
    if not options.quiet:
        print(words)
        print(f"Results are in {options.output}")
    found = report["markers"] if options.image else report["points"]
    return cli.EXIT_DONE if found else cli.EXIT_FAILED


def _look_at_marker(study: PerceptionEvaluation, options: Namespace) -> list[GoalSample]:
    hidden = not cli.shows_progress(options)
    samples = []
    for camera in (CAMERA_TOP, CAMERA_BOTTOM):
        for distance in tqdm(_DISTANCES, desc=camera.name, unit="distance", disable=hidden):
            samples += study.goal((camera,), (distance,), options.samples)
    return samples


def make_report(clouds: dict[str, CloudStudy], samples: list[GoalSample]) -> dict:
    """Returns the content of `report.json`."""
    report: dict = {}
    for name, study in clouds.items():
        report[name] = dataclasses.asdict(study.report) | {"milliseconds": study.milliseconds}
        report[name]["bias"] = dict(zip("xyz", study.report.bias, strict=True))
        if study.report.points == 0:
            report[name]["rms_error"] = None  # Of no points; JSON has no NaN.
    rows = []
    for camera in dict.fromkeys(sample.camera for sample in samples):
        for distance in dict.fromkeys(sample.distance for sample in samples):
            group = [s for s in samples if s.camera == camera and s.distance == distance]
            rows.append({"camera": camera, "distance": distance} | _statistics(group))
    report["goal"] = _statistics(samples) | {"by_distance_and_camera": rows}
    return report


def _statistics(samples: list[GoalSample]) -> dict:
    """Returns statistics of the errors of found goals, null if none was found."""
    found = [sample for sample in samples if sample.found]

    def spread(values: list[float]) -> dict[str, float | None]:
        if not values:
            return {"median": None, "percentile_95": None}
        return {
            "median": float(np.median(values)),
            "percentile_95": float(np.percentile(values, 95)),
        }

    return {
        "position_error": spread([sample.position_error for sample in found]),
        "orientation_error": spread([sample.orientation_error for sample in found]),
        "detection_rate": len(found) / len(samples),
        "milliseconds": float(np.median([sample.milliseconds for sample in samples])),
        "samples": len(samples),
    }


def summary(report: dict) -> str:
    """Returns a summary for the terminal."""
    lines = []
    for name in ("depth", "stereo"):
        cloud = report[name]
        largest = max(abs(value) for value in cloud["bias"].values())
        if cloud["points"] == 0:
            lines.append(f"  {name:7} saw no obstacle")
            continue
        lines.append(
            f"  {name:7} {cloud['points']:6} points   rms {1000 * cloud['rms_error']:.1f} mm   "
            f"bias {1000 * largest:.1f} mm   covers {100 * cloud['coverage']:.1f} %   "
            f"inconsistent {100 * cloud['outlier_share']:.2f} %   "
            f"{cloud['milliseconds']:.1f} ms"
        )
    goal = report["goal"]
    if goal["position_error"]["median"] is None:
        lines.append("  goal    never found")
    else:
        lines.append(
            f"  goal    found {100 * goal['detection_rate']:.0f} %   "
            f"error {1000 * goal['position_error']['median']:.1f} mm (median), "
            f"{1000 * goal['position_error']['percentile_95']:.1f} mm (95 %)   "
            f"{goal['milliseconds']:.1f} ms"
        )
    if "over_poses" in report["depth"]:
        left = report["depth"]["over_poses"]
        lines.append(
            f"  left    {left['robot_points']} points of Pepper and {left['goal_points']} of the "
            f"goal in {left['poses']} poses"
        )
    if "wrong_goals" in goal:
        lines.append(
            f"  wrong   {goal['wrong_goals']['wrong']} goals published in "
            f"{goal['wrong_goals']['frames']} frames without one"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    cli.run(main)
