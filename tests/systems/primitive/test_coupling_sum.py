import pytest

from pepper_drake.systems.primitive.coupling_sum import CouplingSum


@pytest.mark.parametrize("connected", [(), (1,), (0, 2)])
def test_it_adds_up_what_is_connected(connected):
    system = CouplingSum(3)
    context = system.CreateDefaultContext()
    for k in connected:
        system.GetInputPort(f"slowdown_{k}").FixValue(context, [0.5 + k])
        system.GetInputPort(f"coupling_{k}").FixValue(context, [1.0 * k, 2.0, 0.0])
    slowdown = system.GetOutputPort("slowdown").Eval(context)
    coupling = system.GetOutputPort("coupling").Eval(context)
    assert slowdown == pytest.approx([sum(0.5 + k for k in connected)])
    assert coupling == pytest.approx([sum(connected), 2.0 * len(connected), 0.0])
