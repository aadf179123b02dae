"""Ground truth of a simulation, for reports only; nothing that drives the robot may use it."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.systems.framework import connect
from pepper_drake.systems.robot.touch_monitor import TouchMonitor
from pepper_drake.systems.robot.true_clearance import TrueClearance


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
