from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.value import Value

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.errors import InputError
from pepper_drake.systems.primitive.nominal_posture import NominalPosture


@pytest.fixture(scope="module")
def primitive():
    return make_primitive(None, "right")


@pytest.fixture(scope="module")
def mirrored():
    return make_primitive(None, "left")


@pytest.mark.parametrize("time", [0.0, 0.3, 1.0])
def test_the_posture_is_the_one_shown_at_that_phase(primitive, time):
    system = NominalPosture(primitive)
    context = system.CreateDefaultContext()
    system.phase_input.FixValue(context, [np.exp(-primitive.translation.alpha_x * time)])
    shown = primitive.posture.at(np.array([time]))[0]
    np.testing.assert_allclose(system.get_output_port().Eval(context), shown, atol=1e-9)


def test_the_posture_follows_phase_and_primitive(ports, primitive, mirrored):
    rig = ports(NominalPosture(primitive))
    before = {"phase": [1.0], "primitive": Value[object](primitive)}
    after = {"phase": [0.4], "primitive": Value[object](mirrored)}
    assert rig.changes(before, after) == {
        ("phase", "joint_position"),
        ("primitive", "joint_position"),
    }


def test_a_primitive_at_the_port_takes_the_place_of_its_own(primitive, mirrored):
    system = NominalPosture(primitive)
    context = system.CreateDefaultContext()
    system.phase_input.FixValue(context, [0.5])
    system.primitive_input.FixValue(context, Value[object](mirrored))
    other = NominalPosture(mirrored)
    its_context = other.CreateDefaultContext()
    other.phase_input.FixValue(its_context, [0.5])
    expected = other.get_output_port().Eval(its_context)
    np.testing.assert_array_equal(system.get_output_port().Eval(context), expected)


def test_a_primitive_without_posture_is_refused(primitive):
    with pytest.raises(InputError, match="joints"):
        NominalPosture(replace(primitive, posture=None))
