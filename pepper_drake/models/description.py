"""Pepper's description for other programs: a standard URDF, an SRDF and an MJCF.

All are generated from one source, the URDF that Drake reads. Drake's extensions are converted:
frames become links on fixed joints, capsules become their enclosing cylinders in a URDF, and visual
shapes are those seen by the head's cameras, which are boxes and cylinders only.

The links Hip and Pelvis have their origins of NAOqi and ROS, on the upper of their two joints. As
the tree is rooted at the floor, the lower joint carries a massless link before them.

The fingers, which the source omits, are added: each hand has the joint RHand or LHand, from 0,
closed, to 1, open, and its phalanges mimic it. The collision shape is that of the half-open hand,
on the wrist, whatever the opening.
"""

import copy
import math
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from xml.etree import ElementTree as ET

from pepper_drake.models.hands import FINGER_RADIUS, FINGER_RANGE, RELAXED, phalanges
from pepper_drake.models.pepper import JOINT_GROUPS, PEPPER_URDF, posture_positions
from pepper_drake.naoqi.constants import HANDS

DRAKE = "{http://drake.mit.edu}"

LINK_SHIFTS = {
    "Pelvis": ("KneePitch", "knee_pitch", 0.268),
    "Hip": ("HipPitch", "hip_pitch", 0.079),
}
"""Links whose origin is moved up: the joint below, the massless link on it, the height [m]."""

_FINGER_MASS, _FINGER_INERTIA = 2e-6, 1.1e-9
"""Mass [kg] and inertia [kg m^2] of a phalanx: placeholders, as in ROS' description."""
_FINGER_ARMATURE = 1e-5
"""Armature of a phalanx's joint for numerical stability in MuJoCo [kg m^2]; assumed."""

NOTE = " Made from pepper.urdf by `pepper-drake describe`: do not edit. "


def _source() -> ET.Element:
    return ET.parse(PEPPER_URDF).getroot()


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return f'<?xml version="1.0"?>\n<!--{NOTE}-->\n{ET.tostring(root, encoding="unicode")}\n'


def _xyz(element: ET.Element) -> list[float]:
    origin = element.find("origin")
    return [float(v) for v in ("0 0 0" if origin is None else origin.get("xyz", "0 0 0")).split()]


def _shift(element: ET.Element, height: float) -> None:
    """Moves an element's origin down, as its link's origin was moved up by `height` [m]."""
    x, y, z = _xyz(element)
    origin = element.find("origin")
    if origin is None:
        origin = ET.Element("origin")
        element.insert(0, origin)
    origin.set("xyz", f"{x:.9g} {y:.9g} {z - height:.9g}")


def _fixed_link(robot: ET.Element, name: str, parent: str, xyz: str, rpy: str) -> None:
    ET.SubElement(robot, "link", name=name)
    joint = ET.SubElement(robot, "joint", name=f"{name}_joint", type="fixed")
    ET.SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=name)


def _standard_tree(*, keep_capsules: bool = False) -> ET.Element:
    """Returns the source without Drake's extensions, except capsules if they are kept."""
    robot = copy.deepcopy(_source())
    for group in robot.findall(f"{DRAKE}collision_filter_group"):
        robot.remove(group)
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            hidden = visual.find(f"{DRAKE}perception_properties")
            if hidden is not None and hidden.get("enabled") == "false":
                link.remove(visual)
        for shape in (*link.findall("visual"), *link.findall("collision")):
            for child in list(shape):
                if child.tag.startswith(DRAKE):
                    shape.remove(child)
            geometry = shape.find("geometry")
            assert geometry is not None
            capsule = geometry.find(f"{DRAKE}capsule")
            if capsule is not None and not keep_capsules:
                radius, length = float(capsule.get("radius", "")), float(capsule.get("length", ""))
                geometry.remove(capsule)
                size = {"radius": f"{radius:.9g}", "length": f"{length + 2 * radius:.9g}"}
                ET.SubElement(geometry, "cylinder", size)
    for name, (joint_name, carrier, height) in LINK_SHIFTS.items():
        shifted = robot.find(f"link[@name='{name}']")
        assert shifted is not None
        for part in shifted:
            _shift(part, height)
        for joint in robot.findall("joint"):
            above, below = joint.find("parent"), joint.find("child")
            assert above is not None
            assert below is not None
            if above.get("link") == name:
                _shift(joint, height)
            if joint.get("name") == joint_name:
                below.set("link", carrier)
        _fixed_link(robot, f"{name}_origin", carrier, f"0 0 {height}", "0 0 0")
        # The fixed joint's child is the link itself instead of the new one.
        robot.remove(robot.findall("link")[-1])
        end = robot.findall("joint")[-1].find("child")
        assert end is not None
        end.set("link", name)
        ET.SubElement(robot, "link", name=carrier)
    for frame in robot.findall("frame"):
        robot.remove(frame)
        _fixed_link(robot, *(frame.get(key, "0 0 0") for key in ("name", "link", "xyz", "rpy")))
    for transmission in robot.findall("transmission"):
        for part in transmission.iter():
            ratio = part.find(f"{DRAKE}gear_ratio")
            for extra in [c for c in part if c.tag.startswith(DRAKE)]:
                part.remove(extra)
            if ratio is not None:
                ET.SubElement(part, "mechanicalReduction").text = ratio.get("value")
    _add_fingers(robot)
    return robot


def _add_link(
    robot: ET.Element, name: str, joint: dict[str, str], xyz: str, rpy: str
) -> ET.Element:
    """Adds a link of negligible mass on a joint, and returns the joint."""
    link = ET.SubElement(robot, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "mass", value=f"{_FINGER_MASS:.9g}")
    turn = f"{_FINGER_INERTIA:.9g}"
    ET.SubElement(inertial, "inertia", ixx=turn, iyy=turn, izz=turn, ixy="0", ixz="0", iyz="0")
    made = ET.SubElement(robot, "joint", name=joint["name"], type="revolute")
    ET.SubElement(made, "origin", xyz=xyz, rpy=rpy)
    ET.SubElement(made, "parent", link=joint["parent"])
    ET.SubElement(made, "child", link=name)
    ET.SubElement(made, "axis", xyz=joint["axis"])
    effort, velocity = joint.get("effort", "0.144"), joint.get("velocity", "12.56")
    ET.SubElement(made, "limit", lower="0", upper=joint["upper"], effort=effort, velocity=velocity)
    return made


def _add_fingers(robot: ET.Element) -> None:
    """Replaces the half-open fingers drawn on the wrists by articulated ones."""
    for hand in HANDS:
        side = hand[0].lower()
        wrist = robot.find(f"link[@name='{side}_wrist']")
        assert wrist is not None
        for visual in wrist.findall("visual"):
            if visual.get("name", "").startswith(("finger", "thumb")):
                wrist.remove(visual)
        # ROS' gripper link, which turns about its own x and has no children.
        gripper = {"name": hand, "parent": f"{side}_wrist", "axis": "1 0 0", "upper": "1"}
        _add_link(robot, f"{side}_gripper", gripper, "0.025 0 0", "0 0 0")
        for part in phalanges(hand):
            joint = {"name": part.joint, "parent": part.parent, "axis": "0 0 1"}
            joint |= {"upper": f"{FINGER_RANGE:.9g}"}
            xyz, rpy = (" ".join(f"{v:.9g}" for v in row) for row in (part.xyz, part.rpy))
            made = _add_link(robot, part.link, joint, xyz, rpy)
            mimic = {"joint": hand, "multiplier": f"{FINGER_RANGE:.9g}", "offset": "0"}
            ET.SubElement(made, "mimic", mimic)
            link = robot.find(f"link[@name='{part.link}']")
            assert link is not None
            visual = ET.SubElement(link, "visual", name=part.link.removesuffix("_link"))
            middle = f"{part.length / 2:.9g} 0 0"
            ET.SubElement(visual, "origin", xyz=middle, rpy=f"0 {math.pi / 2:.9g} 0")
            geometry = ET.SubElement(visual, "geometry")
            size = {"radius": f"{FINGER_RADIUS:.9g}", "length": f"{part.length:.9g}"}
            ET.SubElement(geometry, "cylinder", size)
            ET.SubElement(visual, "material", name="gray")
        # The total mass remains the source's.
        mass = wrist.find("inertial/mass")
        assert mass is not None
        weight = float(mass.get("value", "")) - (len(phalanges(hand)) + 1) * _FINGER_MASS
        mass.set("value", f"{weight:.9g}")


def standard_urdf() -> str:
    """Returns Pepper as a URDF without any of Drake's tags."""
    return _text(_standard_tree())


def shaped_links() -> tuple[str, ...]:
    """Returns the links that have collision shapes, in the order of the source."""
    links = _source().findall("link")
    return tuple(link.get("name", "") for link in links if link.find("collision") is not None)


def disabled_collisions() -> tuple[tuple[str, str, str], ...]:
    """Returns the pairs of links that are not checked against each other, each with its reason.

    They are pairs connected by a joint, possibly through links without shapes, and those of the
    source's collision filter groups, which overlap by construction.
    """
    robot = _source()
    shaped = set(shaped_links())
    parents = {c.get("link", ""): p.get("link", "") for p, c in _ends(robot)}
    pairs: dict[tuple[str, str], str] = {}
    for link in sorted(shaped):
        above = parents.get(link)
        while above is not None and above not in shaped:
            above = parents.get(above)
        if above is not None:
            pairs[(min(link, above), max(link, above))] = "Adjacent"
    groups = {g.get("name", ""): g for g in robot.findall(f"{DRAKE}collision_filter_group")}
    members = {
        name: [m.get("link", "") for m in group.findall(f"{DRAKE}member")]
        for name, group in groups.items()
    }
    for name, group in groups.items():
        for other in group.findall(f"{DRAKE}ignored_collision_filter_group"):
            for a, b in product(members[name], members[other.get("name", "")]):
                pairs.setdefault((min(a, b), max(a, b)), "Default")
    return tuple((a, b, reason) for (a, b), reason in sorted(pairs.items()))


def _ends(robot: ET.Element) -> Iterator[tuple[ET.Element, ET.Element]]:
    for joint in robot.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        assert parent is not None
        assert child is not None
        yield parent, child


def srdf() -> str:
    """Returns groups, postures, end effectors and disabled collision pairs for the URDF."""
    robot = ET.Element("robot", name="pepper")
    groups = JOINT_GROUPS | {"left_hand": ("LHand",), "right_hand": ("RHand",)}
    for group, names in groups.items():
        element = ET.SubElement(robot, "group", name=group)
        for name in names:
            ET.SubElement(element, "joint", name=name)
    for posture in ("stand", "upright", "crouch"):
        positions = posture_positions(posture) | dict.fromkeys(HANDS, RELAXED)
        for group, names in groups.items():
            state = ET.SubElement(robot, "group_state", name=posture, group=group)
            for name in names:
                ET.SubElement(state, "joint", name=name, value=f"{positions[name]:.9g}")
    for side in "lr":
        arm, hand = (f"{'left' if side == 'l' else 'right'}_{part}" for part in ("arm", "hand"))
        ends = {"parent_link": f"{side}_wrist", "group": hand, "parent_group": arm}
        ET.SubElement(robot, "end_effector", {"name": hand} | ends)
    for a, b, reason in disabled_collisions():
        ET.SubElement(robot, "disable_collisions", link1=a, link2=b, reason=reason)
    return _text(robot)


def _geom(shape: ET.Element, role: str) -> ET.Element:
    """Converts a URDF collision or visual to an MJCF geom; visuals have no contact and no mass."""
    geometry = shape.find("geometry")
    assert geometry is not None
    (form,) = geometry
    kind = form.tag.removeprefix(DRAKE)
    if kind == "box":
        size = [float(v) / 2 for v in form.get("size", "").split()]
    else:
        size = [float(form.get("radius", ""))]
        if kind != "sphere":
            size.append(float(form.get("length", "")) / 2)
    geom = ET.Element("geom", type=kind, size=" ".join(f"{v:.9g}" for v in size))
    geom.set("class", role)
    _place(geom, shape)
    return geom


def _place(target: ET.Element, element: ET.Element) -> None:
    origin = element.find("origin")
    if origin is not None:
        target.set("pos", origin.get("xyz", "0 0 0"))
        target.set("euler", origin.get("rpy", "0 0 0"))


def _body(
    parent: ET.Element, name: str, robot: ET.Element, armature: Callable[[str], float]
) -> ET.Element:
    body = ET.SubElement(parent, "body", name=name)
    link = robot.find(f"link[@name='{name}']")
    assert link is not None
    inertial = link.find("inertial")
    if inertial is not None:
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        assert mass is not None
        assert inertia is not None
        full = " ".join(inertia.get(k, "0") for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
        pos = " ".join(f"{v:.9g}" for v in _xyz(inertial))
        ET.SubElement(body, "inertial", pos=pos, mass=mass.get("value", ""), fullinertia=full)
    for role in ("collision", "visual"):
        body.extend(_geom(shape, role) for shape in link.findall(role))
    for joint in robot.findall("joint"):
        upper, child = joint.find("parent"), joint.find("child")
        assert upper is not None
        assert child is not None
        if upper.get("link") != name:
            continue
        below = _body(body, child.get("link", ""), robot, armature)
        _place(below, joint)
        kind, axis, limit = joint.get("type"), joint.find("axis"), joint.find("limit")
        if kind == "fixed" or axis is None or limit is None:
            continue
        made = ET.Element("joint", name=joint.get("name", ""), axis=axis.get("xyz", ""))
        made.set("type", "slide" if kind == "prismatic" else "hinge")
        made.set("armature", f"{armature(joint.get('name', '')):.9g}")
        made.set("actuatorfrcrange", f"-{limit.get('effort')} {limit.get('effort')}")
        if kind != "continuous":
            made.set("range", f"{limit.get('lower')} {limit.get('upper')}")
        below.insert(0, made)
    return body


def _armatures() -> dict[str, float]:
    """Returns each joint's reflected rotor inertia: gear ratio squared times it [kg m^2]."""
    found = {}
    for transmission in _source().findall("transmission"):
        joint = transmission.find("joint")
        assert joint is not None
        ratio = transmission.find(f".//{DRAKE}gear_ratio")
        rotor = transmission.find(f".//{DRAKE}rotor_inertia")
        if ratio is not None and rotor is not None:
            found[joint.get("name", "")] = float(ratio.get("value", "")) ** 2 * float(
                rotor.get("value", "")
            )
    return found


def mjcf() -> str:
    """Returns Pepper as MuJoCo XML, with capsules and torque motors."""
    robot = _standard_tree(keep_capsules=True)
    fingers = [part.joint for hand in HANDS for part in phalanges(hand)]
    armatures = dict.fromkeys((*HANDS, *fingers), _FINGER_ARMATURE) | _armatures()
    root = ET.Element("mujoco", model="pepper")
    ET.SubElement(root, "compiler", angle="radian", eulerseq="XYZ", autolimits="true")
    defaults = ET.SubElement(root, "default")
    touching = ET.SubElement(defaults, "default", {"class": "collision"})
    ET.SubElement(touching, "geom", group="3")
    seen = ET.SubElement(defaults, "default", {"class": "visual"})
    ET.SubElement(seen, "geom", group="2", contype="0", conaffinity="0", mass="0")
    _body(ET.SubElement(root, "worldbody"), "odom", robot, lambda name: armatures.get(name, 0.0))
    contact = ET.SubElement(root, "contact")
    for a, b, _ in disabled_collisions():
        ET.SubElement(contact, "exclude", body1=a, body2=b)
    actuator = ET.SubElement(root, "actuator")
    coupled = ET.Element("equality")
    for joint in robot.findall("joint"):
        limit, mimic = joint.find("limit"), joint.find("mimic")
        if mimic is not None:
            law = f"0 {mimic.get('multiplier')} 0 0 0"
            pair = {"joint1": joint.get("name", ""), "joint2": mimic.get("joint", "")}
            ET.SubElement(coupled, "joint", pair | {"polycoef": law})
        elif limit is not None:
            effort, name = limit.get("effort", ""), joint.get("name", "")
            ET.SubElement(actuator, "motor", name=name, joint=name, ctrlrange=f"-{effort} {effort}")
    root.insert(list(root).index(actuator), coupled)
    return _text(root)


def description_files() -> dict[Path, str]:
    """Returns the content of each description by its file name."""
    return {
        Path("pepper_standard.urdf"): standard_urdf(),
        Path("pepper.srdf"): srdf(),
        Path("pepper_mjcf.xml"): mjcf(),
    }
