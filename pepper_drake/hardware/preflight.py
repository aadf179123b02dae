"""Checks before a robot is moved: each has a name, a result, and advice."""

import asyncio
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.transport import Transport
from pepper_drake.models.control_model import BODY_JOINTS, arm_joints, shared_control_model
from pepper_drake.models.pepper import hand_frame
from pepper_drake.naoqi.clock import ClockSample, clock_offset, join_time
from pepper_drake.naoqi.constants import BODY, FRAME_TORSO
from pepper_drake.naoqi.streaming import lookahead

HOT = 70.0
"""Temperature at which the robot itself reduces a motor's stiffness [degrees Celsius]."""
LEAST_CHARGE = 15
"""Least battery charge of a run [percent]."""
WITNESS = 0.005
"""Largest distance of the robot's own hand position from ours [m]."""
CLOCK_BOUND = 0.02
"""Error bound of the clock offset above which images of a moving head are misplaced [s]."""
_CALLS = 8


@dataclass(frozen=True)
class PreflightOptions:
    """Options of the preflight.

    Attributes:
        needs_stiffness: Whether the arm must be stiff; recording makes it limp.
        disable_life: Whether to switch off the robot's autonomous life.
    """

    needs_stiffness: bool = True
    disable_life: bool = False


@dataclass(frozen=True)
class Check:
    """The result of a check.

    Attributes:
        name: Subject of the check.
        value: Finding.
        fault: Word of `LINK_FAULTS` if it forbids a run, else "".
        mend: What to do about it.
        is_warning: Whether it is a warning, which forbids nothing.
    """

    name: str
    value: str
    fault: str = ""
    mend: str = ""
    is_warning: bool = False

    def __str__(self) -> str:
        mark = "FAIL" if self.fault else "warn" if self.is_warning else "ok"
        return f"{mark:4}  {self.name}: {self.value}" + (f"; {self.mend}" if self.mend else "")


async def check_robot(transport: Transport, arm: str, options: PreflightOptions) -> list[Check]:
    """Runs all checks.

    Raises:
        LinkFault: A check forbids a run.
    """
    checks = await preflight(transport, arm, options)
    for check in checks:
        if check.fault:
            raise LinkFault(check.fault, f"{check.name}: {check.value}; {check.mend}")
    return checks


async def preflight(transport: Transport, arm: str, options: PreflightOptions) -> list[Check]:
    """Runs all checks and returns their results; they end if the robot is not a Pepper."""
    model = await _model(transport)
    if model.fault:
        return [model]
    return [
        model,
        await _version(transport),
        await _life(transport, options),
        await _awake(transport),
        await _stiffness(transport, arm, options),
        await _temperatures(transport, arm),
        await _battery(transport),
        await _hatch(transport),
        await _check_hand_pose(transport, arm),
        *await _timing(transport),
    ]


async def _data(transport: Transport, key: str) -> Any:
    """Returns a value of ALMemory, or None."""
    try:
        return await transport.call("ALMemory", "getData", key)
    except LinkFault as fault:
        if fault.word != "call_failed":
            raise
        return None


async def _model(transport: Transport) -> Check:
    kind = await _data(transport, "RobotConfig/Body/Type")
    names = await transport.call("ALMotion", "getBodyNames", "Body")
    is_pepper = str(kind).lower() == "juliette" and list(names) == list(BODY)
    if is_pepper:
        version = await _data(transport, "RobotConfig/Body/BaseVersion")
        return Check("model", f"Pepper, body {version}")
    mend = "give the address of a Pepper"
    return Check("model", f"{kind} with {len(names)} joints", "wrong_robot", mend)


async def _version(transport: Transport) -> Check:
    try:
        version = str(await transport.call("ALSystem", "systemVersion"))
    except LinkFault as fault:
        if fault.word not in ("call_failed", "service_missing"):
            raise
        return Check("NAOqi", "unknown", mend="only 2.5 was planned for", is_warning=True)
    if version.startswith("2.5"):
        return Check("NAOqi", version)
    return Check("NAOqi", version, mend="only 2.5 was planned for", is_warning=True)


async def _life(transport: Transport, options: PreflightOptions) -> Check:
    try:
        state = str(await transport.call("ALAutonomousLife", "getState"))
        if state != "disabled" and options.disable_life:
            await transport.call("ALAutonomousLife", "setState", "disabled")
            state = str(await transport.call("ALAutonomousLife", "getState"))
    except LinkFault as fault:
        if fault.word != "service_missing":
            raise
        return Check("autonomous life", "there is none")
    if state == "disabled":
        return Check("autonomous life", state)
    mend = "switch it off (--disable-life, or twice on the chest button): it would move the arms"
    return Check("autonomous life", state, "robot_not_ready", mend)


async def _awake(transport: Transport) -> Check:
    if await transport.call("ALMotion", "robotIsWakeUp"):
        return Check("posture", "awake")
    return Check("posture", "at rest", "robot_not_ready", "wake it up: press the chest button")


async def _stiffness(transport: Transport, arm: str, options: PreflightOptions) -> Check:
    names = list(arm_joints(arm))
    stiffnesses = await transport.call("ALMotion", "getStiffnesses", names)
    value = f"{min(stiffnesses):.2f} or more in the {arm} arm"
    if min(stiffnesses) < 0.3 and options.needs_stiffness:
        return Check("stiffness", value, "robot_not_ready", "wake it up, or set the stiffness to 1")
    return Check("stiffness", value)


async def _temperatures(transport: Transport, arm: str) -> Check:
    keys = [f"Device/SubDeviceList/{n}/Temperature/Sensor/Value" for n in arm_joints(arm)]
    values = [v for v in await transport.call("ALMemory", "getListData", keys) if v is not None]
    if not values:
        return Check("motors", "temperature unknown", mend="feel them", is_warning=True)
    hottest = max(map(float, values))
    if hottest >= HOT:
        return Check("motors", f"{hottest:.0f} degrees", "robot_not_ready", "let them cool")
    return Check("motors", f"{hottest:.0f} degrees at most")


async def _battery(transport: Transport) -> Check:
    try:
        charge = int(await transport.call("ALBattery", "getBatteryCharge"))
    except LinkFault as fault:
        if fault.word not in ("call_failed", "service_missing"):
            raise
        return Check("battery", "unknown", is_warning=True)
    if charge < LEAST_CHARGE:
        return Check("battery", f"{charge} %", "robot_not_ready", "charge it")
    return Check("battery", f"{charge} %")


async def _hatch(transport: Transport) -> Check:
    is_open = await _data(transport, "BatteryTrapIsOpen")
    if is_open:
        return Check("hatch", "open", "robot_not_ready", "close it: the base does not move")
    return Check("hatch", "unknown" if is_open is None else "closed", is_warning=is_open is None)


async def _check_hand_pose(transport: Transport, arm: str) -> Check:
    """Compares our forward kinematics of the measured joints with the robot's own."""
    name = f"{arm[0].upper()}Arm"
    angles, reported = await asyncio.gather(
        transport.call("ALMotion", "getAngles", "Body", True),
        transport.call("ALMotion", "getPosition", name, FRAME_TORSO, True),
    )
    model = shared_control_model()
    context = model.create_context()
    positions = np.array(angles)[[BODY.index(joint) for joint in BODY_JOINTS]]
    model.plant.SetPositions(context, model.positions(positions, np.zeros(3)))
    X_TH = model.pose(context, hand_frame(arm), "torso")
    X_TH_robot = RigidTransform(RollPitchYaw(reported[3:6]), reported[:3])
    error = float(np.linalg.norm(X_TH.translation() - X_TH_robot.translation()))
    turn = RotationMatrix(X_TH.rotation().inverse() @ X_TH_robot.rotation()).ToAngleAxis().angle()
    value = f"{error * 1000:.1f} mm and {np.degrees(turn):.1f} degrees from our kinematics"
    if error > WITNESS:
        mend = "the model is not this robot's: nothing may be reached for with it"
        return Check("hand", value, "wrong_robot", mend)
    return Check("hand", value)


async def _timing(transport: Transport) -> list[Check]:
    samples = []
    for _ in range(_CALLS):
        asked = time.monotonic()
        key = "Device/SubDeviceList/HeadYaw/Position/Sensor/Value"
        stamp = await transport.call("ALMemory", "getTimestamp", key)
        samples.append(ClockSample(asked, time.monotonic(), join_time(stamp[1], stamp[2])))
    trip = float(np.median([s.answered - s.asked for s in samples]))
    bound = clock_offset(samples).bound
    checks = [Check("link", f"{trip * 1000:.1f} ms to an answer")]
    if lookahead(trip) is None:
        mend = "use a cable, or a network of its own"
        checks = [Check("link", f"{trip * 1000:.0f} ms to an answer", "link_slow", mend)]
    is_loose = bound > CLOCK_BOUND
    mend = "images of a moving head will be a little off" if is_loose else ""
    checks.append(Check("clock", f"known to {bound * 1000:.1f} ms", "", mend, is_loose))
    return checks
