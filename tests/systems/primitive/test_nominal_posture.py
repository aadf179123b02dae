import numpy as np
import pytest

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.systems.primitive.nominal_posture import NominalPosture
from tests.systems.motion_example import moving


@pytest.fixture(scope="module")
def primitive():
    return make_primitive(None, "right")


@pytest.fixture(scope="module")
def mirrored():
    return make_primitive(None, "left")


@pytest.mark.parametrize("time", [0.0, 0.3, 1.0])
def test_the_posture_is_the_one_shown_at_that_phase(primitive, time):
    system = NominalPosture()
    context = system.CreateDefaultContext()
    system.movement_input.FixValue(context, moving(primitive))
    system.phase_input.FixValue(context, [np.exp(-primitive.translation.alpha_x * time)])
    shown = primitive.posture.at(np.array([time]))[0]
    np.testing.assert_allclose(system.get_output_port().Eval(context), shown, atol=1e-9)


def test_the_posture_follows_phase_and_primitive(ports, primitive, mirrored):
    rig = ports(NominalPosture())
    before = {"phase": [1.0], "movement": moving(primitive)}
    after = {"phase": [0.4], "movement": moving(mirrored)}
    assert rig.changes(before, after) == {
        ("phase", "joint_position"),
        ("movement", "joint_position"),
    }
