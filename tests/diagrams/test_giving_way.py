import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

from pepper_drake.diagrams.giving_way import GivingWay, connect_couplings
from pepper_drake.diagrams.reach_run import ReachRun, RunOptions
from pepper_drake.diagrams.reach_setup import make_coupling, make_primitive, prepare_scene
from pepper_drake.diagrams.reaching import Reaching, ReachingConfig
from pepper_drake.models.scene import load_scene
from pepper_drake.systems.push import PushScript


def acting(builder, slowdown, coupling):
    """A system with the two outputs of what acts on a movement."""
    inner = DiagramBuilder()
    for name, value in (("slowdown", [slowdown]), ("coupling", coupling)):
        source = inner.AddSystem(ConstantVectorSource(value))
        inner.ExportOutput(source.get_output_port(), name)
    return builder.AddSystem(inner.Build())


def target(builder, name, size):
    inner = DiagramBuilder()
    through = inner.AddSystem(PassThrough(size))
    inner.ExportInput(through.get_input_port(), name)
    inner.ExportOutput(through.get_output_port(), "seen")
    return builder.AddSystem(inner.Build())


@pytest.mark.parametrize("count", [1, 2, 3])
def test_all_that_acts_is_added_up(count):
    builder = DiagramBuilder()
    systems = [acting(builder, 0.5 + k, [1.0 * k, 2.0, 0.0]) for k in range(count)]
    canonical, translation = target(builder, "slowdown", 1), target(builder, "coupling", 3)
    sums = connect_couplings(builder, systems, canonical, translation)
    assert sorted(sums) == ["coupling", "slowdown"]
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    seen = {
        system: system.GetOutputPort("seen").Eval(system.GetMyContextFromRoot(context))
        for system in (canonical, translation)
    }
    numbers = range(count)
    assert seen[canonical] == pytest.approx([sum(0.5 + k for k in numbers)])
    assert seen[translation] == pytest.approx([sum(numbers), 2.0 * count, 0.0])


def test_where_nothing_acts_nothing_is_connected():
    builder = DiagramBuilder()
    canonical, translation = target(builder, "slowdown", 1), target(builder, "coupling", 3)
    assert connect_couplings(builder, [], canonical, translation) == {}


@pytest.mark.render
def test_a_reach_that_is_pushed_comes_to_its_goal_all_the_same():
    scene = prepare_scene(load_scene("free"))
    giving_way = GivingWay(pushes=(PushScript((0.0, 0.0, 5.0), 1.5, 0.5),))
    reaching = Reaching(
        scene,
        make_primitive(None, scene.arm),
        make_coupling(scene.coupling),
        ReachingConfig(giving_way=giving_way),
    )
    run = ReachRun(reaching, RunOptions(progress=False))
    result = run.run()
    report, log = result.report, result.log
    assert (report.outcome, report.reason, report.contacts) == ("reached", "", 0)
    assert report.final_position_error < 0.01
    push = reaching.logs["push"].FindLog(run.simulator.get_context()).data().T
    pushing = push[:, 5] > 0.0
    assert np.count_nonzero(pushing) == pytest.approx(50, abs=1)
    deviation = log.hand_position_torso_m - log.desired_position_torso_m
    assert np.linalg.norm(deviation[pushing], axis=1).max() > 0.015
    # The phase falls more slowly while the hand is pushed than just before.
    rates = -np.diff(np.log(log.phase)) / np.diff(log.time_s)
    start = int(np.argmax(pushing))
    assert rates[start + 30 : start + 50].mean() < 0.8 * rates[start - 20 : start].mean()
