import pytest
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.systems.robot.true_clearance import TrueClearance

RADIUS = 0.1


class Rig:
    """A robot of one sphere on a rail along x; obstacle at x = 1, something else at x = -0.5."""

    def __init__(self, obstacle_first=False):
        builder = DiagramBuilder()
        self.plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        inertia = SpatialInertia.SolidSphereWithMass(1.0, RADIUS)
        link = self.plant.AddRigidBody("link", inertia)
        self.rail = self.plant.AddJoint(
            PrismaticJoint("rail", self.plant.world_frame(), link.body_frame(), [1, 0, 0])
        )
        spheres = {
            "link": (link, RigidTransform()),
            "obstacle": (self.plant.world_body(), RigidTransform([1.0, 0, 0])),
        }
        # Geometry ids grow with registration, and a pair comes in their order.
        names = sorted(spheres, reverse=obstacle_first)
        ids = {name: self._sphere(*spheres[name], name) for name in names}
        robot, obstacle = ids["link"], ids["obstacle"]
        world = self.plant.world_body()
        self._sphere(world, RigidTransform([-0.5, 0, 0]), "goal")
        self.plant.Finalize()
        self.monitor = builder.AddSystem(
            TrueClearance(robot={robot}, obstacles={obstacle}, max_distance=0.3)
        )
        builder.Connect(scene_graph.get_query_output_port(), self.monitor.query_input)
        self.scene_graph = scene_graph
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()

    def _sphere(self, body, X, name):
        return self.plant.RegisterCollisionGeometry(
            body, X, Sphere(RADIUS), name, CoulombFriction(0.5, 0.5)
        )

    def place(self, x):
        context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.rail.set_translation(context, x)


@pytest.mark.parametrize(
    ("x", "distance"),
    [(0.7, 0.1), (0.55, 0.25), (0.8, 0.0), (0.85, -0.05), (0.0, 0.3), (-0.5, 0.3)],
)
@pytest.mark.parametrize("obstacle_first", [True, False])
def test_the_distance_to_the_obstacle_and_to_nothing_else(x, distance, obstacle_first):
    rig = Rig(obstacle_first)
    rig.place(x)
    query = rig.scene_graph.get_query_output_port().Eval(
        rig.scene_graph.GetMyContextFromRoot(rig.context)
    )
    least, names = rig.monitor.closest_pair(query)
    assert least == pytest.approx(distance, abs=1e-9)
    assert names == ("link - obstacle of world" if distance < 0.3 else "")


def test_the_output_is_the_distance_at_the_last_tick():
    rig = Rig()
    port = rig.monitor.get_output_port()
    context = rig.monitor.GetMyContextFromRoot(rig.context)
    assert port.Eval(context)[0] == 0.3
    rig.place(0.7)
    assert port.Eval(context)[0] == 0.3
    rig.simulator.AdvanceTo(0.001)
    assert port.Eval(context)[0] == pytest.approx(0.1, abs=1e-6)
    assert not rig.monitor.HasAnyDirectFeedthrough()


@pytest.mark.parametrize("start", [0.495, 0.45, 0.3, 0.13])
def test_what_comes_as_fast_as_it_can_is_noticed_before_it_touches(start):
    rig = Rig()
    port = rig.monitor.get_output_port()
    context = rig.monitor.GetMyContextFromRoot(rig.context)
    for n in range(100):
        x = start + 1.5 * 0.02 * n
        if x > 0.8:
            break
        rig.place(x)
        rig.simulator.AdvanceTo(0.02 * n + 0.001)
    assert port.Eval(context)[0] < 0.3


def test_what_is_near_is_looked_at_at_every_step():
    rig = Rig()
    port = rig.monitor.get_output_port()
    context = rig.monitor.GetMyContextFromRoot(rig.context)
    for n in range(6):
        rig.place(0.55 + 0.02 * n)
        rig.simulator.AdvanceTo(0.02 * n + 0.001)
        assert port.Eval(context)[0] == pytest.approx(0.25 - 0.02 * n, abs=1e-4)
