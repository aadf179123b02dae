"""Ground truth of a simulation, for reports only; nothing that drives the robot may use it."""

import numpy as np
import numpy.typing as npt
from pydrake.geometry import QueryObject
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.results.reach_report import CloudReport
from pepper_drake.systems.framework import connect
from pepper_drake.systems.robot.touch_monitor import TouchMonitor
from pepper_drake.systems.robot.true_clearance import TrueClearance

Vector = npt.NDArray[np.float64]


def add_ground_truth(
    builder: DiagramBuilder, station: PepperStation
) -> tuple[TrueClearance, dict[str, OutputPort]]:
    """Adds monitors of a station's true clearance and contact forces.

    Returns:
        The clearance monitor; and the ports `clearance` (1) [m], `contact_force` (2) [N] and
        `state`, the plant's.
    """
    robot, obstacles = station.robot_geometries(), station.obstacle_geometries()
    clearance = builder.AddNamedSystem(
        "clearance_monitor", TrueClearance(robot=robot, obstacles=obstacles)
    )
    touch = builder.AddNamedSystem(
        "touch_monitor", TouchMonitor(robot=station.robot_bodies(), goal=station.goal_bodies())
    )
    connect(builder, station, clearance, **{"ground_truth.query": "query"})
    connect(builder, station, touch, **{"ground_truth.contact_results": "contact_results"})
    return clearance, {
        "contact_force": touch.get_output_port(),
        "state": station.GetOutputPort("ground_truth.state"),
        "clearance": clearance.get_output_port(),
    }


def measure_cloud(station: PepperStation, query: QueryObject, points_W: Vector) -> CloudReport:
    """Compares a cloud with the true geometry.

    Args:
        station: The station.
        query: Its present geometry.
        points_W: (P, 3) [m].
    """
    robot, goal = station.robot_geometries(), station.goal_geometries()
    obstacles = station.obstacle_geometries()
    report, squares = CloudReport(points=len(points_W)), []
    for point in points_W:
        distances = query.ComputeSignedDistanceToPoint(point, 0.3)
        nearest = [abs(d.distance) for d in distances if d.id_G in obstacles]
        squares.append(min(nearest, default=0.3) ** 2)
        report.robot_points += any(d.distance <= 0 for d in distances if d.id_G in robot)
        report.goal_points += any(d.distance <= 0 for d in distances if d.id_G in goal)
    if squares:
        report.rms_error = float(np.sqrt(np.mean(squares)))
    return report
