"""Numbers of modules: a tuned one belongs to a dataclass that the scenario loads."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "pepper_drake"
ROOMS = ("diagrams", "perception", "planning", "systems")

KINDS = {
    "layout": "index into a vector or code of a choice",
    "numeric": "tolerance, grid, batch or iteration count of a computation",
    "format": "limit or code of a file, message or image format, or of input that makes sense",
    "geometry": "shape of the robot, or of an object in its scenes",
    "physics": "property of a simulated sensor or actuator",
    "sentinel": "value for nothing, or for never",
    "offline": "calibration, teaching, evaluation, search or a run's end, outside the loop",
}

ALLOWED = {
    "diagrams/calibration_run.py": {
        "offline": (
            "SPEED ACCELERATION _APPROACH_TIME SETTLING _LOOKING _EDGE_SIGMA _PEAK_SPEED "
            "_PEAK_ACCELERATION"
        ),
    },
    "diagrams/factory.py": {"numeric": "SHORTEST_PATH"},
    "diagrams/head_perception.py": {"sentinel": "_EVER"},
    "diagrams/marker_teaching.py": {"offline": "OUT_OF_REACH"},
    "diagrams/reach_simulation.py": {"offline": "_AFTERMATH"},
    "diagrams/recording.py": {"offline": "_SLICE", "numeric": "_EPSILON"},
    "diagrams/reproduction_simulation.py": {
        "offline": "_SLICE _REST_SPEED LONGEST _LIMIT_TOLERANCE"
    },
    "diagrams/robot_signals.py": {"format": "_BEYOND _FARTHEST"},
    "diagrams/simulate.py": {"numeric": "_KEEP_PERIOD _KEEP_SHARE _ROUNDING"},
    "diagrams/station.py": {"physics": "_STRENGTH _GEAR_FRICTION"},
    "diagrams/taught_movement.py": {"offline": "_STRIDE"},
    "diagrams/touch_report.py": {"offline": "_NEAR _REST_SPEED"},
    "perception/calibration/marker_calibration.py": {
        "offline": "FEWEST_POSTURES _ROUNDS _SETTLED _LEAST_SIGMA _OUTLIER _NAMED"
    },
    "perception/calibration/marker_kinematics.py": {"layout": "_JOINTS _OF_CAMERA"},
    "perception/cameras/camera.py": {
        "format": "_CLOSEST _LARGEST_IMAGE _LARGEST_DISTORTION _LARGEST_FOCAL",
        "geometry": "CAMERA_TOP CAMERA_BOTTOM CAMERA_DEPTH",
    },
    "perception/cameras/camera_files.py": {
        "format": "_OFF_CENTRE _SHORTEST_FOCAL _LARGEST NAOQI_RESOLUTIONS _NAOQI_CAMERAS"
    },
    "perception/cameras/image_files.py": {"format": "_LARGEST _MOST_PIXELS"},
    "perception/cameras/images.py": {"format": "_FEWEST_LEVELS _CHANNELS"},
    "perception/cameras/noise.py": {"physics": "_SHIFTS", "sentinel": "NO_DEPTH_NOISE"},
    "perception/cameras/structured_light.py": {
        "physics": "_SHADOW_STEP _NEAREST _STRIDE _BEND _PATCH_CELLS _PATCH_CELL _PATCH_BLUR"
    },
    "perception/cloud_evaluation.py": {"offline": "COVERED_WITHIN INCONSISTENT_BEYOND _FARTHEST"},
    "perception/gaze/gaze_policy.py": {
        "layout": "_UP",
        "sentinel": "_AT_REST",
        "numeric": "_SAME_IMAGE",
    },
    "perception/gaze/head_aiming.py": {
        "geometry": "P_T_NECK HEAD_YAW_LIMIT",
        "numeric": "_HALVINGS",
        "layout": "_SEARCH_VIEWS",
    },
    "perception/gaze/view_planning.py": {
        "physics": "_NEAREST",
        "numeric": "VIEW_POINTS",
    },
    "perception/goal/imm_filter.py": {"layout": "_REST _MOVING"},
    "perception/goal/marker.py": {
        "format": "_LARGEST_SIDE",
        "numeric": "_WORTHLESS _NUDGE _IMMERKAER",
    },
    "perception/goal/marker_edges.py": {"numeric": "_SAMPLES _OFFSETS _WORST_CONDITION"},
    "perception/mapping/cloud.py": {
        "format": "_MANY _NEAREST_MM _FARTHEST_ROOM",
    },
    "perception/mapping/cloud_files.py": {"format": "_LARGEST _FARTHEST _FARTHEST_ROOM"},
    "perception/mapping/depth_holes.py": {
        "numeric": "_CELL _RING _HOLE_WIDTH _HOLE_EDGE _PLACE_STEP _THING_DEPTHS",
    },
    "perception/mapping/depth_image_mapper.py": {"numeric": "_POSES"},
    "perception/mapping/depth_scale.py": {
        "numeric": "_MOST_PIXELS _LEAST_PIXELS _AROUND _STEPS _TOUCH",
    },
    "perception/mapping/depth_validity.py": {
        "format": "_NOTHING",
        "numeric": "_FLOOR_STRIDE _NOISE_STRIDE _NEIGHBOURS",
    },
    "perception/mapping/dynamic_obstacles.py": {
        "sentinel": "_NOWHERE",
        "numeric": "_NARROW _WIDE _REGISTRATIONS",
    },
    "perception/mapping/near_field_occlusion.py": {"numeric": "_PITCH _STEP _BORDER _BESIDE"},
    "perception/mapping/projector_shadow.py": {"geometry": "BOTH_SIDES"},
    "perception/mapping/voxel_map.py": {
        "layout": "_FINE_KEYS _KEY_BITS _KEY_OFFSET",
        "numeric": "_LEAST_PIXELS",
    },
    "perception/stereo/matching.py": {"geometry": "STEREO_BASELINE _EYE"},
    "perception/stereo/segmentation.py": {"numeric": "_ROUND"},
    "planning/calibration/calibration_postures.py": {
        "offline": (
            "APPROACH _PADDING _MARGIN _FACING _NEAREST _FARTHEST _AROUND _AHEAD _LARGEST_YAW "
            "_CANDIDATES _BATCH _BATCHES _SPARE _STEP _PIXEL"
        ),
    },
    "planning/collision/arm_collision_checker.py": {
        "numeric": "GRID_SPACING GRID_CAP",
        "layout": "CLOUD CLOUD_AND_BODY",
    },
    "planning/collision/clearance_table.py": {"numeric": "FARTHEST"},
    "planning/collision/exact_distance.py": {"numeric": "NEAR _SPACING"},
    "planning/collision/path_distances.py": {"numeric": "_STRIDE"},
    "planning/collision/sphere_model.py": {"numeric": "_CELL _ROUNDING"},
    "planning/ik/batch_ik.py": {
        "numeric": "_DAMPING",
        "offline": "_POSTURE_GAIN",
    },
    "planning/collision/compiled_grid.py": {"numeric": "ROUNDING"},
    "planning/ik/goal_configurations.py": {
        "numeric": "_LIBRARY_SIZE _SEED _STEPS _DAMPING _TOLERANCE _LARGEST_STEP"
    },
    "planning/safety/compiled_limits.py": {"numeric": "SHARES ROUNDING"},
    "planning/safety/safe_command.py": {"numeric": "_SAME"},
    "planning/reach/barrier_for_path.py": {"numeric": "_CANDIDATE_DISTANCES"},
    "planning/reach/base_placement.py": {"numeric": "_BATCH"},
    "planning/reach/base_placement_planner.py": {"numeric": "_ROUNDING"},
    "planning/reach/lean_params.py": {"geometry": "MIN_HIP_PITCH MAX_HIP_PITCH"},
    "planning/reach/leaning.py": {"layout": "_CENTRE"},
    "planning/reach/movement_from_path.py": {"numeric": "_SAMPLES"},
    "planning/reach/observation.py": {"format": "_FUTURE"},
    "planning/reach/drive_supervision.py": {"numeric": "ROUNDING"},
    "planning/reach/steadiness.py": {"numeric": "_SAMPLE"},
    "planning/trajectories/compiled_cost.py": {"numeric": "_TERMS"},
    "planning/trajectories/joint_trajectories.py": {"numeric": "_DEGREE"},
    "planning/trajectories/retreat.py": {"numeric": "_STRONGEST_BRAKING"},
    "planning/trajectories/trajectory_adapter.py": {"layout": "PLANNED", "numeric": "_LOOKED_AT"},
    "systems/faults/corruption.py": {"sentinel": "_FAR_OUTSIDE"},
    "systems/faults/fault.py": {"layout": "SIGNALS"},
    "systems/faults/faulty_planner.py": {"sentinel": "_FAR"},
    "systems/primitive/canonical_system.py": {"layout": "_GOAL _NUMBER"},
    "systems/primitive/hand_goal_pose.py": {"numeric": "_TOLERANCE"},
    "systems/primitive/orientation_transformation_system.py": {"layout": "_NUMBER _SPEED"},
    "systems/robot/arm_command.py": {"sentinel": "_REST"},
    "systems/sensing/estimate_guard.py": {"format": "_FARTHEST _FARTHEST_GOAL _LARGEST_SHARE"},
    "systems/sensing/goal_estimator.py": {"numeric": "_THUMBNAIL_STEP"},
    "systems/sensing/marker_tracker.py": {"sentinel": "_NEVER"},
    "systems/sensing/moving_marker.py": {"geometry": "_THICKNESS _WHITE"},
}
"""Names at module level that hold numbers, by file and kind."""


def numbers(text):
    """Names (with lines) that are assigned something with a number in it, at module level."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign):
            targets = node.targets
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            targets = [node.target]
        else:
            continue
        constants = (n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant))
        if any(type(value) in (int, float) for value in constants):
            for target in targets:
                for name in ast.walk(target):
                    if isinstance(name, ast.Name):
                        yield name.id, node.lineno


def allowed(path):
    kinds = ALLOWED.get(path, {})
    return {name for names in kinds.values() for name in names.split()}


def test_no_tuned_number_stands_in_a_module():
    new, gone = [], []
    for room in ROOMS:
        for file in sorted((PACKAGE / room).rglob("*.py")):
            path = str(file.relative_to(PACKAGE))
            found = dict(numbers(file.read_text()))
            new += [f"{path}:{found[name]}: {name}" for name in found if name not in allowed(path)]
            gone += [f"{path}: {name}" for name in allowed(path) - found.keys()]
    assert not new, (
        f"{', '.join(new)}: a number that was tuned belongs, with its unit and reason, to a "
        "dataclass that pepper_drake/scenario.py loads, so that --set reaches it; one that was "
        "not, to the list in this file, with its kind"
    )
    assert not gone, f"{', '.join(gone)}: no number of that name; take it off the list"
    files = [path for path in ALLOWED if not (PACKAGE / path).exists()]
    assert not files, f"{files}: no such file; take it off the list"


def test_kinds_are_those_that_are_explained():
    assert {kind for kinds in ALLOWED.values() for kind in kinds} == KINDS.keys()


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("_NEAR = 0.6", ["_NEAR"]),
        ("A, _B = 1, -2.0", ["A", "_B"]),
        ("GRID: Vector = np.linspace(0.0, 1.0, 5)", ["GRID"]),
        ("SLOW = BaseMotion(tolerance=0.005)", ["SLOW"]),
        ("FLAG, WORD, DEFAULT = True, 'six', Params()", []),
        ("@dataclass\nclass Params:\n    near: float = 0.6\n\ndef f():\n    x = 2", []),
    ],
)
def test_numbers_are_found_at_module_level_alone(text, names):
    assert [name for name, _ in numbers(text)] == names
