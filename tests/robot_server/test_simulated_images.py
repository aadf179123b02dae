import time

import pytest

from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.scene import load_scene
from pepper_drake.naoqi.constants import BOTTOM, DEPTH, TOP
from pepper_drake.robot_server.robot.simulated_robot import SimulatedRobot
from pepper_drake.robot_server.robot.simulator import LATENCY, SimulatorConfig


@pytest.mark.render
def test_images_come_from_a_robot_that_is_simulated_faster_than_they_are_rendered():
    station = StationConfig()
    station.camera_latency = LATENCY * station.camera_period
    with SimulatedRobot(SimulatorConfig(load_scene("free"), station, rate=0.0)) as robot:
        robot.wait_until_ready()
        for camera in (TOP, BOTTOM, DEPTH):
            robot.want_image(camera, 640, 480, 5.0)
        stamps = {TOP: set(), BOTTOM: set(), DEPTH: set()}
        start = robot.state().time
        while robot.state().time < start + 2.0:
            for camera, seen in stamps.items():
                if image := robot.image(camera):
                    seen.add(round(image.time - start, 3))
            time.sleep(0.005)
    # Five images a second, the first some time after it was asked for; none is left out.
    for seen in stamps.values():
        assert len(seen) >= 7, seen
