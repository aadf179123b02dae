import numpy as np
import pytest

from pepper_drake.systems.nominal_posture import NominalPosture

START, END = np.array([1.4, -0.2, 1.2, 0.5, 0.0]), np.array([0.8, -0.4, 0.9, 1.0, 0.3])


def between(phase):
    return END + phase * (START - END)


@pytest.mark.parametrize("phase", [1.0, 0.25, 0.0])
def test_the_posture_is_that_of_the_phase(phase):
    system = NominalPosture(between)
    context = system.CreateDefaultContext()
    system.phase_input.FixValue(context, [phase])
    np.testing.assert_array_equal(system.get_output_port().Eval(context), between(phase))


def test_the_posture_follows_the_phase(ports):
    rig = ports(NominalPosture(between))
    assert rig.changes({"phase": [1.0]}, {"phase": [0.4]}) == {("phase", "joint_position")}


def test_the_posture_is_computed_once_a_phase():
    phases = []

    def posture(phase):
        phases.append(phase)
        return between(phase)

    system = NominalPosture(posture)
    context = system.CreateDefaultContext()
    system.phase_input.FixValue(context, [0.5])
    for time in (0.0, 0.1, 0.2):
        context.SetTime(time)
        system.get_output_port().Eval(context)
    assert phases == [0.5]
