"""A benchmark case: a scene, and the seed of all random numbers in its run."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

from pepper_drake.diagrams.factory import prepare_scene
from pepper_drake.models.random_scene import random_scene
from pepper_drake.models.scene import Scene, load_scene
from pepper_drake.models.scene_families import family_scene
from pepper_drake.scenario import Scenario, load_scenario


@dataclass(frozen=True)
class Case:
    """One scene with one seed.

    Attributes:
        seed: Seed of the random scene, of sensor noise and of all other random numbers.
        scene: A shipped scene's name or a file; the seed's random scene if None.
        moving: Whether an obstacle of the random scene moves during the reach.
        arm: "left" or "right"; the scene's if None.
        goal_motion: Motion of the goal; see `prepare_scene`.
        robot: "ideal", or "worn" for the seed's worn robot.
        faults: Injected faults, as SIGNAL:KIND@START[+DURATION].
        calibration: File with the robot's calibration; `{seed}` in it stands for the seed.
        family: Family of the random scene; a table with loose objects on it if None.
        sensors: "real", or "ideal" for cameras without noise or latency.
        numbers: A scenario file with parameters of the loop; the defaults if None.
    """

    seed: int
    scene: str | None = None
    moving: bool = False
    arm: str | None = None
    goal_motion: str | None = None
    robot: str = "ideal"
    faults: tuple[str, ...] = ()
    calibration: str | None = None
    family: str | None = None
    sensors: str = "real"
    numbers: str | None = None

    def build(self) -> Scene:
        """Returns the scene.

        Raises:
            InputError: The scene does not exist.
        """
        if self.family is not None:
            scene = family_scene(self.family, self.seed, moving=self.moving)
        elif self.scene is None:
            scene = random_scene(self.seed, moving=self.moving)
        else:
            scene = load_scene(self.scene)
        return prepare_scene(scene, arm=self.arm, motion=self.goal_motion)

    def scenario(self) -> Scenario:
        """Returns the scenario of a reach.

        Raises:
            InputError: A scene or file does not exist.
        """
        chosen = Scenario() if self.numbers is None else load_scenario(Path(self.numbers))
        station = replace(
            chosen.station,
            goal_motion_port=self.goal_motion is not None,
            obstacle_motion_ports=self.moving,
        )
        if self.sensors == "ideal":
            station.noise, station.camera_latency = False, 0.0
        return replace(
            chosen,
            seed=self.seed,
            scene=self.build(),
            robot=self.robot,
            calibration=self.calibration or "",
            faults=list(self.faults),
            station=station,
        )

    @property
    def name(self) -> str:
        """Name for files, such as `random_17`, `moving_17`, `table_seed_3`, `random_17_left_up`."""
        if self.family is not None:
            name = f"{'moving_' if self.moving else ''}{self.family}_{self.seed}"
        elif self.scene is None:
            name = f"{'moving' if self.moving else 'random'}_{self.seed}"
        else:
            stem = self.scene.rpartition("/")[2].removesuffix(".yaml")
            name = f"{stem}_seed_{self.seed}"
        motion = self.goal_motion and self.goal_motion.rpartition("/")[2].partition(".")[0]
        robot = "" if self.robot == "ideal" else self.robot
        faults = [re.sub(r"[^a-z0-9.]+", "_", fault) for fault in self.faults]
        calibrated = "calibrated" if self.calibration else ""
        sensors = "" if self.sensors == "real" else f"{self.sensors}_sensors"
        words = (name, self.arm, motion, robot, calibrated, sensors, *faults)
        return "_".join(word for word in words if word)

    @property
    def reach_options(self) -> list[str]:
        """Options of `reach.py` for the same scene and noise."""
        scene = (
            ["--random-scene", str(self.seed)] if self.scene is None else ["--scene", self.scene]
        )
        if self.family is not None:
            scene = ["--family", self.family, *scene]
        options = [*scene, "--seed", str(self.seed)]
        if self.numbers is not None:
            options += ["--scenario", self.numbers]
        if self.moving:
            options.append("--moving")
        if self.arm is not None:
            options += ["--arm", self.arm]
        if self.goal_motion is not None:
            options += ["--goal-motion", self.goal_motion]
        if self.robot != "ideal":
            options += ["--robot", self.robot]
        if self.calibration is not None:
            options += ["--calibration", self.calibration]
        if self.sensors == "ideal":
            options += ["--set", "station.noise=false", "--set", "station.camera_latency=0"]
        for fault in self.faults:
            options += ["--fault", fault]
        return options
