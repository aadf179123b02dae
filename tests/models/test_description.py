"""Pepper's description for other programs: the same robot as Drake's, and never out of date."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Role
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.models.control_model import ControlModel, shared_control_model
from pepper_drake.models.description import (
    description_files,
    disabled_collisions,
    shaped_links,
    standard_urdf,
)
from pepper_drake.models.hands import FINGER_RADIUS, RELAXED, phalanges
from pepper_drake.models.pepper import (
    MODELS_DIR,
    joint_names,
    posture_positions,
    set_joint_positions,
)
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.planning.collision.sphere_file import sphere_yaml

INTEROP = "needs the extra interop"
FRAMES = ("r_hand_effector", "l_hand_effector", "CameraBottom_optical_frame", "torso")
COMMITTED = MODELS_DIR / "pepper"


@pytest.fixture(scope="module")
def model() -> ControlModel:
    return shared_control_model()


def random_postures(model: ControlModel, count: int) -> list[dict[str, float]]:
    rng = np.random.default_rng(16)
    postures = []
    for _ in range(count):
        q = {}
        for name in joint_names():
            joint = model.plant.GetJointByName(name)
            lower = max(joint.position_lower_limits()[0], -3.0)
            upper = min(joint.position_upper_limits()[0], 3.0)
            q[name] = float(rng.uniform(lower, upper))
        q |= {name: float(rng.uniform(0.0, 1.0)) for name in HANDS}
        postures.append(q)
    return postures


def drake_positions(model: ControlModel, q: dict[str, float]) -> dict[str, np.ndarray]:
    context = model.create_context()
    body = {name: value for name, value in q.items() if name not in HANDS}
    set_joint_positions(model.plant, context, model.model_instance, body)
    return {name: model.pose(context, name).GetAsMatrix4() for name in FRAMES}


def num_shapes(model: ControlModel) -> int:
    """The 25 shapes that collide: 10 boxes, 8 cylinders, 5 spheres and 2 capsules."""
    return model.diagram.scene_graph().model_inspector().NumGeometriesWithRole(Role.kProximity)


def test_committed_files_are_those_made_from_the_source() -> None:
    for name, text in (description_files() | {Path("pepper_spheres.yaml"): sphere_yaml()}).items():
        assert (COMMITTED / name).read_text() == text, f"{name}: run pepper-drake describe"


def test_urdf_has_no_tag_but_the_standard_ones(model: ControlModel) -> None:
    root = ET.fromstring(standard_urdf())
    assert not [e.tag for e in root.iter() if "}" in e.tag or e.tag == "frame"]
    assert len(root.findall("link/collision")) == num_shapes(model)
    children = {e.get("link") for e in root.findall("joint/child")}
    links = {e.get("name") for e in root.findall("link")}
    assert links - children == {"odom"}
    assert children <= links


def test_the_pairs_that_are_not_checked_are_drakes(model: ControlModel) -> None:
    inspector, plant = model.diagram.scene_graph().model_inspector(), model.plant
    of = {
        name: inspector.GetGeometries(
            plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(name).index()), Role.kProximity
        )[0]
        for name in shaped_links()
    }
    filtered = {
        (a, b) for a in of for b in of if a < b and inspector.CollisionFiltered(of[a], of[b])
    }
    assert {(a, b) for a, b, _ in disabled_collisions()} == filtered


def test_spheres_name_links_of_the_urdf() -> None:
    spheres = yaml.safe_load(sphere_yaml())["collision_spheres"]
    assert set(spheres) == set(shaped_links())
    assert all(s["radius"] > 0 for group in spheres.values() for s in group)


@pytest.mark.parametrize("hand", HANDS)
def test_all_fingers_turn_and_those_of_a_half_open_hand_are_in_the_shape_that_collides(
    hand,
) -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason=INTEROP)
    robot = yourdfpy.URDF.load(str(COMMITTED / "pepper_standard.urdf"), load_meshes=False)
    wrist = f"{hand[0].lower()}_wrist"
    boxes = [c for c in robot.link_map[wrist].collisions if c.name in ("palm", "fingers")]
    reach, sticks_out = {}, {}
    for opening in (*np.linspace(0.0, 1.0, 11), 0.02, 0.98):
        robot.update_cfg({hand: opening})
        ends = []
        for part in phalanges(hand):
            X = robot.get_transform(part.link, wrist)
            ends += [X[:3, 3], X[:3, 3] + part.length * X[:3, 0]]
        outside = np.min(
            [
                np.max(np.abs(ends - c.origin[:3, 3]) + FINGER_RADIUS - c.geometry.box.size / 2, 1)
                for c in boxes
            ],
            axis=0,
        )
        sticks_out[opening] = float(np.max(outside))
        reach[opening] = float(np.max(ends, axis=0)[0]) + FINGER_RADIUS
    assert max(out for opening, out in sticks_out.items() if opening <= RELAXED) < 0.0
    assert sticks_out[1.0] == pytest.approx(0.024, abs=0.001)
    # The meshes of ROS' description end 107, 118 and 141 mm from the wrist.
    np.testing.assert_allclose(
        [reach[k] for k in (0.02, 0.5, 0.98)], [0.107, 0.118, 0.141], atol=0.006
    )


def test_mujoco_has_drakes_poses_masses_and_shapes(model: ControlModel) -> None:
    mujoco = pytest.importorskip("mujoco", reason=INTEROP)
    robot = mujoco.MjModel.from_xml_path(str(COMMITTED / "pepper_mjcf.xml"))
    data = mujoco.MjData(robot)
    assert int((robot.geom_contype > 0).sum()) == num_shapes(model)
    mass = model.plant.CalcTotalMass(model.create_context())
    assert robot.body_mass.sum() == pytest.approx(mass, rel=1e-9)
    for q in random_postures(model, 20):
        for name, value in q.items():
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(robot, data)
        for name, X_WF in drake_positions(model, q).items():
            np.testing.assert_allclose(data.body(name).xpos, X_WF[:3, 3], atol=1e-6)
            np.testing.assert_allclose(data.body(name).xmat.reshape(3, 3), X_WF[:3, :3], atol=1e-6)


def test_pinocchio_has_drakes_poses_and_shapes(model: ControlModel) -> None:
    pin = pytest.importorskip("pinocchio", reason=INTEROP)
    path = str(COMMITTED / "pepper_standard.urdf")
    robot = pin.buildModelFromUrdf(path)
    shapes = pin.buildGeomFromUrdf(robot, path, pin.GeometryType.COLLISION)
    assert shapes.ngeoms == num_shapes(model)
    data = robot.createData()
    for q in random_postures(model, 20):
        values = pin.neutral(robot)
        for name, value in q.items():
            joint = robot.joints[robot.getJointId(name)]
            # A continuous joint is stored as cosine and sine.
            part = [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
            values[joint.idx_q : joint.idx_q + joint.nq] = part
        pin.framesForwardKinematics(robot, data, values)
        for name, X_WF in drake_positions(model, q).items():
            X = data.oMf[robot.getFrameId(name)].homogeneous
            np.testing.assert_allclose(X, X_WF, atol=1e-6)


def test_yourdfpy_has_drakes_poses_and_shapes(model: ControlModel) -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason=INTEROP)
    robot = yourdfpy.URDF.load(
        str(COMMITTED / "pepper_standard.urdf"), build_collision_scene_graph=True
    )
    assert sum(len(link.collisions) for link in robot.robot.links) == num_shapes(model)
    # Its scene has one mesh for each link that has a shape: none was left out.
    assert len(robot.collision_scene.geometry) == len(shaped_links())
    for q in random_postures(model, 20):
        robot.update_cfg(q)
        for name, X_WF in drake_positions(model, q).items():
            np.testing.assert_allclose(robot.get_transform(name), X_WF, atol=1e-6)


def test_roboplan_has_drakes_poses_shapes_and_pairs(model: ControlModel) -> None:
    roboplan = pytest.importorskip("roboplan.core", reason=INTEROP)
    path = str(COMMITTED / "pepper_standard.urdf")
    scene = roboplan.Scene("pepper", roboplan.loadUrdfSceneDescription(path))
    assert len(scene.getRobotCollisionGeometryIds()) == num_shapes(model)
    scene.importSrdf((COMMITTED / "pepper.srdf").read_text())
    values = np.array(scene.getCurrentJointPositions())
    # Upright, arms at its sides: what the SRDF leaves to be checked does not collide.
    for name, value in posture_positions("stand").items():
        part = scene.getJointPositionIndices([name])
        values[part] = [np.cos(value), np.sin(value)] if len(part) == 2 else [value]
    assert not scene.hasCollisions(values)
    for q in random_postures(model, 20):
        for name, value in q.items():
            part = scene.getJointPositionIndices([name])
            values[part] = [np.cos(value), np.sin(value)] if len(part) == 2 else [value]
        for name, X_WF in drake_positions(model, q).items():
            np.testing.assert_allclose(scene.forwardKinematics(values, name), X_WF, atol=1e-6)


def test_viser_has_drakes_poses_and_shapes(model: ControlModel) -> None:
    viser = pytest.importorskip("viser", reason="viser draws the pages")
    extras = pytest.importorskip("viser.extras", reason=INTEROP)
    pytest.importorskip("yourdfpy", reason=INTEROP)
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        robot = extras.ViserUrdf(
            server, COMMITTED / "pepper_standard.urdf", load_collision_meshes=True
        )
        # A mesh for each link that has a shape, as yourdfpy hands them on.
        drawn = [mesh.name for mesh in robot._meshes if mesh.name.startswith("/collision/")]
        assert len(drawn) == len(shaped_links())
        frames = {frame.name: frame for frame in robot._joint_frames}
        names = robot.get_actuated_joint_names()
        for q in random_postures(model, 5):
            robot.update_cfg(np.array([q[name] for name in names]))
            for name, X_WF in drake_positions(model, q).items():
                path = next(path for path in frames if path.endswith(f"/{name}"))
                X = RigidTransform()  # A frame of the page is placed in the one that it is below.
                for end in [k for k, c in enumerate(path) if c == "/" and k] + [len(path)]:
                    if (frame := frames.get(path[:end])) is not None:
                        turn = RotationMatrix(Quaternion(frame.wxyz / np.linalg.norm(frame.wxyz)))
                        X = X @ RigidTransform(turn, frame.position)
                np.testing.assert_allclose(X.GetAsMatrix4(), X_WF, atol=1e-6)
    finally:
        server.stop()
