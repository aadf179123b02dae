"""The API as a user meets it: `help()`, texts of objects, and their figures in a notebook."""

import importlib
import inspect
import pkgutil
import re
from dataclasses import is_dataclass
from functools import cache

import numpy as np
import pytest
from pydrake.systems import framework

import pepper_drake
from pepper_drake import learning, models, optimization, perception, planning
from pepper_drake.learning.demonstrations.check import examine
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.systems.primitive.canonical_system import CanonicalSystem

SKIPPED = re.compile(r"pepper_drake\.(apps|__main__)")


def modules():
    for found in pkgutil.walk_packages(pepper_drake.__path__, "pepper_drake."):
        if not SKIPPED.match(found.name):
            yield importlib.import_module(found.name)


def is_system(value):
    return inspect.isclass(value) and issubclass(value, framework.LeafSystem)


@cache
def public():
    """Name and value of all that packages export, and of each LeafSystem."""
    found = {}
    for module in modules():
        exported = {name: getattr(module, name) for name in getattr(module, "__all__", ())}
        made = {
            name: value
            for name, value in vars(module).items()
            if is_system(value) and value.__module__ == module.__name__ and name[0] != "_"
        }
        for name, value in {**made, **exported}.items():
            found.setdefault(id(value), (f"{module.__name__}.{name}", value))
    return sorted(found.values(), key=lambda pair: pair[0])


def systems():
    return [(name, value) for name, value in public() if is_system(value)]


def signature(value):
    try:
        return inspect.signature(value)
    except (TypeError, ValueError):
        return None


LONG_SIGNATURES = {
    # Tables of tuned numbers: a field for each, set by name in a scenario's file.
    "pepper_drake.perception.GoalFilterParameters",
    "pepper_drake.planning.ReachPlannerParams",
    # Records: a field for each column of a file, each answer of a check or each measurement.
    "pepper_drake.learning.DemonstrationReport",
    "pepper_drake.learning.demonstrations.importers.ImportOptions",
    "pepper_drake.learning.demonstrations.importers.Track",
    "pepper_drake.perception.DynamicObstacleTracker",
    "pepper_drake.planning.Observation",
    "pepper_drake.planning.ReachPlan",
}
"""Those above 300 characters. Grouping their fields would hide what `help()` is to show."""


def test_signatures_can_be_read():
    """At most 300 characters, but for those named: 36 for each parameter."""
    found = {name: signature(value) for name, value in public() if callable(value)}
    long = {name: one for name, one in found.items() if one and len(str(one)) > 300}
    assert set(long) == LONG_SIGNATURES
    assert [name for name, one in long.items() if len(str(one)) > 36 * len(one.parameters)] == []


def test_a_signature_names_types_without_their_modules():
    shown = str(inspect.signature(models.Scene))
    assert "robot: RobotStart = <factory>" in shown
    assert "arm='right'" in shown
    assert "." not in shown
    estimator = importlib.import_module("pepper_drake.systems").GoalEstimator
    assert "top: CameraIntrinsics | None = None" in str(inspect.signature(estimator))


def test_help_of_a_system_names_each_argument_of_its_constructor():
    assert len(systems()) > 50
    silent = []
    for name, value in systems():
        found = signature(value)
        text = f"{value.__doc__}\n{value.__init__.__doc__}"
        for argument in found.parameters if found else ():
            if not re.search(rf"^ *{argument}: \S", text, flags=re.MULTILINE):
                silent.append(f"{name}({argument})")
    assert not silent


def test_a_system_for_a_scalar_type_shows_what_it_is_given():
    parameters = inspect.signature(CanonicalSystem).parameters
    assert list(parameters) == ["primitive", "duration", "time_step"]


def objects():
    several = example_demonstrations(3)
    demo = several[0]
    primitive = learning.MovementPrimitive.fit(demo)
    yield from (demo, primitive, primitive.rollout(), examine(demo))
    yield learning.fit_promp(several)
    yield learning.fit_gaussian_mixture(np.random.default_rng(0).normal(size=(60, 3)), 3)
    yield learning.plan_chain([learning.Step(primitive), learning.Step(primitive)])
    yield optimization.make_task(primitive, obstacles=np.zeros((400, 3)))
    yield perception.VoxelMap.empty()
    yield models.load_scene("table")
    yield ReachPlannerParams(reach_margin=0.1)
    for _, value in public():
        if is_dataclass(value) and inspect.isclass(value):
            required = [
                parameter
                for parameter in inspect.signature(value).parameters.values()
                if parameter.default is parameter.empty
            ]
            if not required:
                yield value()


def test_texts_of_objects_fit_on_a_few_lines():
    shown = [repr(one) for one in objects()]
    assert len(shown) > 30
    assert [text for text in shown if len(text) > 300] == []


def test_a_text_tells_what_differs_from_the_default():
    assert repr(planning.ReachPlannerParams()) == "ReachPlannerParams()"
    assert (
        repr(planning.ReachPlannerParams(reach_margin=0.1))
        == "ReachPlannerParams(reach_margin=0.1)"
    )


def test_a_notebook_shows_a_figure():
    points = np.random.default_rng(1).uniform(size=(50, 3))
    zeros = np.zeros(50)
    cloud = perception.VoxelMap(np.arange(50), points, 0 * points, zeros, zeros, zeros)
    (demo,) = example_demonstrations(1)
    for one in (demo, learning.MovementPrimitive.fit(demo), cloud):
        assert re.match(r'<img alt="\w+\(.*" src="data:image/png;base64,iVBOR', one._repr_html_())


def test_what_has_no_figure_is_named():
    view = importlib.import_module("pepper_drake.reporting.notebook_view")
    with pytest.raises(TypeError, match="int has no figure"):
        view.draw(3)
