"""Scripts that press the buttons of a live session, guide the hand and move objects."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pepper_drake.errors import InputError, PepperDrakeError
from pepper_drake.live.controls import BUTTONS
from pepper_drake.live.session import Mode
from pepper_drake.live.show import LiveApp
from pepper_drake.models.guide import ViaPoint
from pepper_drake.models.motion import FARTHEST, LONGEST
from pepper_drake.models.pepper import MODELS_DIR
from pepper_drake.models.scene import make_pose
from pepper_drake.models.typed_yaml import load_yaml
from pepper_drake.systems.guiding.scripted_guide import GuidePath

SCRIPTS_DIR = MODELS_DIR / "sessions"
SCRIPTS = ("story",)
"""Names of the scripts shipped with the package."""


@dataclass
class ScriptStep:
    """At most one action, `press`, `lead`, `move` or `until`, and a waiting time after it."""

    press: str = ""  # A button of the page.
    lead: list[ViaPoint] = field(default_factory=list)  # Guided hand poses; times from the start.
    move: str = ""  # An object's name in the scene ...
    to: list[float] = field(default_factory=list)  # ... and its new offset x, y, z in W [m].
    until: str = ""  # A mode to wait for, for at most `wait`.
    wait: float = 0.0  # Simulated time [s].


@dataclass
class LiveScript:
    """Script of a session: the user's actions on the page, step by step."""

    name: str = ""
    description: str = ""
    arm: str = "right"  # The arm that `lead` is for.
    steps: list[ScriptStep] = field(default_factory=list)

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, for an invalid value."""
        if self.arm not in ("left", "right"):
            raise InputError(f'arm is "{self.arm}"; it must be left or right')
        if not self.steps:
            raise InputError("steps is empty; a script needs at least one step")
        for index, step in enumerate(self.steps):
            _check_step(step, f"steps[{index}]")

    def mirrored(self) -> "LiveScript":
        """Returns the script for the other arm, mirrored at the robot's x-z plane."""
        mirror = deepcopy(self)
        mirror.arm = "left" if self.arm == "right" else "right"
        for step in mirror.steps:
            for via in step.lead:
                via.position[1] *= -1
                via.rpy[0::2] = [-angle for angle in via.rpy[0::2]]
            if step.to:
                step.to[1] *= -1
        return mirror


def load_script(name_or_path: str) -> LiveScript:
    """Loads and checks a shipped script, by its name, or a YAML file.

    Raises:
        InputError: It is invalid; one sentence names the file and the field.
    """
    path = Path(name_or_path)
    if name_or_path in SCRIPTS:
        path = SCRIPTS_DIR / f"{name_or_path}.yaml"
    elif not path.exists():
        raise InputError(f"{path} is neither a script nor one that ships: {', '.join(SCRIPTS)}")
    script = load_yaml(LiveScript, path)
    try:
        script.check()
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return script


def play(show: LiveApp, script: LiveScript, tell: Callable[[str], None]) -> None:
    """Performs a script on the page itself.

    Args:
        show: The session and its page.
        script: Script for the session's arm and scene.
        tell: Called with one line about each action and its result.

    Raises:
        PepperDrakeError: The mode that a step waits for was not reached.
        InputError: The script moves an object that is not movable.
    """
    for step in script.steps:
        session = show.session
        if step.press:
            show.press(step.press)
            show.step()
            tell(f"{session.simulation.time:6.2f} s  {step.press}: {session.status}")
        elif step.lead:
            _lead(show, step)
            tell(f"{session.simulation.time:6.2f} s  led the hand: {session.status}")
        elif step.move:
            show.move(step.move, np.array(step.to))
            tell(f"{session.simulation.time:6.2f} s  moved {step.move}")
        _wait(show, step)
        if step.until:
            tell(f"{session.simulation.time:6.2f} s  {session.status}")


def _lead(show: LiveApp, step: ScriptStep) -> None:
    """Guides the hand from its present pose through via points."""
    session = show.session
    path = GuidePath(
        [0.0, *(via.time for via in step.lead)],
        [session.simulation.guide_pose(), *(make_pose(via.position, via.rpy) for via in step.lead)],
    )
    began = session.simulation.time
    while session.simulation.time - began < path.end_time:
        show.lead(path.pose(session.simulation.time - began))
        show.step()


def _wait(show: LiveApp, step: ScriptStep) -> None:
    session = show.session
    end = session.simulation.time + step.wait
    while session.simulation.time < end and (not step.until or session.mode != step.until):
        show.step()
    if step.until and session.mode != step.until:
        raise PepperDrakeError(
            f"waited {step.wait:g} s for Pepper to be {step.until}; it says: {session.status}"
        )


def _check_step(step: ScriptStep, name: str) -> None:
    kinds = [key for key in ("press", "lead", "move", "until") if getattr(step, key)]
    if len(kinds) > 1:
        raise InputError(f"{name} has {' and '.join(kinds)}; give each its own step")
    if step.press and step.press not in BUTTONS:
        raise InputError(f'{name}.press is "{step.press}"; it must be one of {", ".join(BUTTONS)}')
    if step.until and step.until not in list(Mode):
        raise InputError(f'{name}.until is "{step.until}"; it must be one of {", ".join(Mode)}')
    if not 0.0 <= step.wait <= LONGEST:
        raise InputError(f"{name}.wait is {step.wait:g} s; it must be finite and not negative")
    if step.move and (len(step.to) != 3 or not np.all(np.abs(step.to) <= FARTHEST)):
        raise InputError(f"{name}.to must be three finite numbers, an offset x, y, z")
    previous = 0.0
    for number, via in enumerate(step.lead):
        for key, vector in (("position", via.position), ("rpy", via.rpy)):
            if len(vector) != 3 or not np.all(np.abs(vector) <= FARTHEST):
                raise InputError(f"{name}.lead[{number}].{key} must be three finite numbers")
        if not previous + 1e-3 <= via.time <= LONGEST:
            raise InputError(f"{name}.lead[{number}].time must be above 0 and increase")
        previous = via.time
    if len(step.lead) == 1:
        raise InputError(f"{name}.lead holds one pose; it needs at least two")
