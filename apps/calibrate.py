"""Calibrate a robot: a marker on its hand, twenty postures, and what its cameras see of it.

Offsets of the encoders, the slack of the gears, and where and how the two colour cameras are
mounted are estimated together, each with its standard deviation, and kept in calibration.yaml,
which reach.py, teach.py and benchmark.py take with --calibration. Nothing but the robot's own
images and encoders is used. It takes the robot a little over a minute, and needs free space in
front of it. Put the marker (DICT_4X4_50, by default number 12 of 50 mm) flat on the back of the
hand, its top towards the fingers; where exactly is found, too.

  calibrate.py --robot worn --seed 3          the used robot of seed 3
  reach.py --robot worn --seed 3 --calibration out/calibrate/calibration.yaml
  calibrate.py --station naoqi --robot tcp://192.168.1.10:9559     a real Pepper, or a served one
  calibrate.py --robot worn --arm left --postures 12 --reason "new left wrist"

Results: calibration.yaml, calibration.json; simulated, also scenario.yaml. Exit code 0: calibrated;
1: the marker was seen too seldom, or does not fit the robot; 2: bad input; 130: ended by Ctrl-C.
"""

import json
from argparse import ArgumentParser, Namespace
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.cli_scenario import add_scenario_options, scenario_of
from pepper_drake.diagrams.calibration_run import (
    CalibrationParams,
    CalibrationResult,
    calibrate_simulated,
)
from pepper_drake.errors import InputError
from pepper_drake.hardware.calibration_run import calibrate_robot
from pepper_drake.hardware.options import (
    add_link_options,
    check_station,
    robot_access,
)
from pepper_drake.hardware.run_options import hardware_run
from pepper_drake.models.robot_calibration import (
    RobotCalibration,
    save_calibration,
    simulated_robot,
)
from pepper_drake.models.robot_wear import ROBOTS
from pepper_drake.models.scene import HandMarker
from pepper_drake.perception.calibration.marker_calibration import (
    FEWEST_POSTURES,
    robot_calibration,
)
from pepper_drake.perception.goal.marker import MARKER_DICTIONARY, check_marker
from pepper_drake.results.folder import whole_results
from pepper_drake.scenario import save_scenario

RESULTS = ("calibration.yaml", "calibration.json", "scenario.yaml")
"""Output files of a run."""

MOST_POSTURES = 60


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("calibrate", __doc__)
    parser.add_argument(
        "--robot",
        metavar="ideal|worn|ADDRESS",
        default="worn",
        help="with --station naoqi the address of a Pepper, as tcp://192.168.1.10:9559; simulated, "
        "ideal or worn: with the errors that the seed draws (default: %(default)s)",
    )
    add_link_options(parser)
    add_scenario_options(parser, ("station",))
    parser.add_argument(
        "--arm",
        choices=("left", "right"),
        default="right",
        help="the arm that holds the marker (default: %(default)s)",
    )
    parser.add_argument(
        "--postures",
        type=int,
        default=20,
        metavar="N",
        help=f"{FEWEST_POSTURES} to {MOST_POSTURES} (default: %(default)s)",
    )
    parser.add_argument(
        "--marker",
        type=int,
        default=HandMarker().id,
        metavar="ID",
        help="the marker's number (default: %(default)s)",
    )
    parser.add_argument(
        "--size",
        type=float,
        default=HandMarker().size,
        metavar="M",
        help="side of its black square, m (default: %(default)s)",
    )
    parser.add_argument(
        "--reason",
        default="routine",
        metavar="TEXT",
        help="why it is calibrated, for the file (default: %(default)s)",
    )
    return parser


def chosen_params(options: Namespace) -> CalibrationParams:
    """Returns the calibration's parameters from the options.

    Raises:
        InputError: One of them is invalid.
    """
    if not FEWEST_POSTURES <= options.postures <= MOST_POSTURES:
        raise InputError(
            f"--postures is {options.postures}; give {FEWEST_POSTURES} to {MOST_POSTURES}"
        )
    if not 0.02 <= options.size <= 0.08:
        raise InputError(
            f"--size is {options.size:g} m; a marker of 0.02 to 0.08 m is seen and fits on the hand"
        )
    try:
        check_marker(MARKER_DICTIONARY, options.marker)
    except InputError as error:
        raise InputError(f"--marker: {error}") from None
    if not options.reason.strip().isprintable() or not options.reason.strip():
        raise InputError("--reason must be plain text")
    marker = HandMarker(id=options.marker, size=options.size)
    return CalibrationParams(options.arm, options.postures, marker)


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    cli.quiet_libraries()
    params = chosen_params(options)
    is_robot = check_station(options, {"scenario": None, "set": []})
    scenario = replace(scenario_of(options), seed=options.seed)
    if options.robot in ROBOTS:
        scenario.robot = options.robot
    robot = (
        robot_access(options).address if is_robot else simulated_robot(options.robot, options.seed)
    )
    with (
        cli.stop_on_interrupt() as should_stop,
        tqdm(
            total=params.postures,
            unit=" posture",
            leave=False,
            disable=not cli.shows_progress(options),
        ) as bar,
    ):
        if is_robot:
            run = hardware_run(options, should_stop)
            result = calibrate_robot(params, options.seed, run, lambda _: bar.update())
        else:
            result = calibrate_simulated(
                params,
                scenario.reaching_config().station,
                on_look=lambda _: bar.update(),
                should_stop=should_stop,
            )
    if result is None:
        return cli.EXIT_INTERRUPTED
    calibration = robot_calibration(
        result.estimate,
        robot=robot,
        arm=params.arm,
        reason=options.reason.strip(),
        date=datetime.now(UTC),
    )
    with whole_results(options.output, RESULTS) as folder:
        save_calibration(calibration, folder / "calibration.yaml")
        numbers = json.dumps(report(result, params), indent=2)
        (folder / "calibration.json").write_text(numbers + "\n")
        if not is_robot:
            save_scenario(scenario, folder / "scenario.yaml")
    if not options.quiet:
        print(summary(calibration, result))
        print(f"Results are in {options.output}")
    return cli.EXIT_DONE


def report(result: CalibrationResult, params: CalibrationParams) -> dict:
    """Returns the content of `calibration.json`."""
    estimate = result.estimate
    return {
        "names": list(estimate.model.names),
        "parameters": estimate.parameters.tolist(),
        "sigmas": estimate.sigmas.tolist(),
        "covariance": np.round(estimate.covariance, 15).tolist(),
        "held": list(estimate.held),
        "robot_seconds": result.robot_seconds,
        "postures_asked_for": params.postures,
        "images_left_out": estimate.left_out,
    }


def summary(calibration: RobotCalibration, result: CalibrationResult) -> str:
    """Returns a table for the terminal."""
    found = calibration.residuals
    lines = [
        f"marker against joints: {1000 * found.position_before:.1f} mm and "
        f"{np.degrees(found.rotation_before):.2f}° by the model, "
        f"{1000 * found.position_after:.2f} mm and {np.degrees(found.rotation_after):.2f}° "
        f"calibrated ({found.images} images of {found.postures} postures, "
        f"{found.image_after:.2f} pixels)",
        "joint             offset [°]         slack [°]",
    ]
    for name, joint in calibration.joints.items():
        lines.append(
            f"  {name:15}"
            + _degrees(joint.offset, joint.offset_sigma)
            + "   "
            + _degrees(joint.slack, joint.slack_sigma)
        )
    lines.append("camera            place [mm]                  turn [°]                focal [%]")
    for name, camera in calibration.cameras.items():
        place = " ".join(f"{1000 * x:6.2f}" for x in camera.position)
        turn = " ".join(f"{np.degrees(x):6.3f}" for x in camera.rotation)
        lines.append(
            f"  {name:15} {place}   {turn}   {100 * (camera.focal - 1):6.3f} ± "
            f"{100 * camera.focal_sigma:.3f}"
        )
    for direction in calibration.held:
        lines.append(f"not told apart by the images, held at what is usual: {direction}")
    lines.append(f"the robot took {result.robot_seconds:.0f} s")
    return "\n".join(lines)


def _degrees(angle: float, sigma: float) -> str:
    return f"{np.degrees(angle):7.3f} ± {np.degrees(sigma):.3f}"


if __name__ == "__main__":
    cli.run(main)
