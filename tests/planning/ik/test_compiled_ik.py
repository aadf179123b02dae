"""The compiled inverse kinematics against Drake's system and against an interior point solver."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from pydrake.systems.framework import BusValue

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import hand_frame
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.ik.compiled_ik import CompiledIk
from pepper_drake.planning.ik.compiled_tick import solve_box_qp
from pepper_drake.planning.ik.differential_ik import (
    DifferentialIkParams,
    arm_joint_limits,
    hand_key,
)
from tests.planning.ik.drake_ik import make_differential_ik

PARAMS = DifferentialIkParams()
MODEL = shared_control_model()
TWIST = np.repeat([PARAMS.angular_velocity_limit, PARAMS.linear_velocity_limit], 3) * [[-1], [1]]


def minimum(H, g, low, high):
    """The same program by Clarabel."""
    program = MathematicalProgram()
    v = program.NewContinuousVariables(len(g))
    program.AddQuadraticCost(H, -g, v, is_convex=True)
    program.AddBoundingBoxConstraint(low, high, v)
    result = ClarabelSolver().Solve(program)
    assert result.is_success()
    return result.GetSolution(v)


def assert_minimum(found, H, g, low, high):
    """First-order conditions: no slope inside, outward at bounds; enough, as H is definite."""
    assert np.all(found >= low - 1e-12)
    assert np.all(found <= high + 1e-12)
    slope = (g - H @ found) / np.abs(H).max()
    below, above = found <= low + 1e-12, found >= high - 1e-12
    np.testing.assert_allclose(slope[~below & ~above], 0.0, atol=1e-9)
    assert np.all(slope[below & ~above] <= 1e-9)
    assert np.all(slope[above & ~below] >= -1e-9)


@given(st.integers(0, 2**32 - 1), st.floats(-2, 5))
@settings(max_examples=30, deadline=None)
def test_the_minimum_in_a_box_is_that_of_an_interior_point_solver(seed, exponent):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(3, 5))
    H = 10**exponent * (J.T @ J) + np.eye(5)
    g = H @ rng.normal(size=5)
    low, high = -rng.uniform(0, 1, 5), rng.uniform(0, 1, 5)
    found = solve_box_qp(H, g, low, high)
    assert_minimum(found, H, g, low, high)
    by_other = minimum(H, g, low, high)
    assert (
        0.5 * found @ H @ found - g @ found <= 0.5 * by_other @ H @ by_other - g @ by_other + 1e-6
    )


def program(arm, q, nominal, X_TH):
    """The program that `DifferentialIkParams` states, of the plant's own Jacobian."""
    plant, context = MODEL.plant, MODEL.create_context()
    rows = MODEL.position_indices(arm_joints(arm))
    whole = np.zeros(plant.num_positions())
    whole[rows] = q
    plant.SetPositions(context, whole)
    torso, hand = (plant.GetFrameByName(name) for name in ("torso", hand_frame(arm)))
    X = plant.CalcRelativeTransform(context, torso, hand)
    J = plant.CalcJacobianSpatialVelocity(
        context, JacobianWrtVariable.kV, hand, np.zeros(3), torso, torso
    )[:, rows]
    turn = (X_TH.rotation() @ X.rotation().inverse()).ToAngleAxis()
    error = np.concatenate((turn.angle() * turn.axis(), X_TH.translation() - X.translation()))
    twist = np.clip(PARAMS.tracking_gain / PARAMS.time_step * error, *TWIST)
    weights = np.repeat([PARAMS.orientation_weight, PARAMS.position_weight], 3)
    pull = PARAMS.posture_gain * (nominal - q)
    H, g = J.T @ (weights[:, None] * J), J.T @ (weights * twist)
    for row in J[:2]:
        m = int(np.argmax(np.abs(row)))
        others = [k for k in range(5) if k != m]
        P = np.eye(5)[others]
        P[:, m] = -row[others] / row[m]
        H, g = H + P.T @ P, g + P.T @ P @ pull
    return H, g


def velocity_bounds(arm, q):
    """Velocity limits, slowed near the position limit that is nearer."""
    rows = MODEL.position_indices(arm_joints(arm))
    limits = arm_joint_limits(MODEL, arm, PARAMS)
    below, above = q - limits.position_lower()[rows], limits.position_upper()[rows] - q
    slowed = np.interp(
        np.minimum(below, above), [PARAMS.limit_margin, PARAMS.limit_influence], [0.0, 1.0]
    )
    return (
        limits.velocity_lower()[rows] * np.where(above < below, 1.0, slowed),
        limits.velocity_upper()[rows] * np.where(above < below, slowed, 1.0),
    )


@pytest.mark.parametrize("arm", ["left", "right"])
def test_velocities_are_those_of_the_stated_program_and_of_drakes_system(arm):
    kinematics = arm_kinematics(MODEL, arm)
    compiled = CompiledIk(MODEL, kinematics.chain, arm, PARAMS)
    system = make_differential_ik(MODEL, arm, PARAMS)
    context = system.CreateDefaultContext()
    rows = MODEL.position_indices(arm_joints(arm))
    limits = arm_joint_limits(MODEL, arm, PARAMS)
    rng = np.random.default_rng(4)
    polished = []
    for far in [3e-3, 0.3] * 20:
        q = rng.uniform(limits.position_lower()[rows], limits.position_upper()[rows])
        nominal = q + rng.normal(scale=0.1, size=5)
        X_TH = kinematics.hand_pose(q + rng.normal(scale=far, size=5))
        found = compiled.velocity(
            q, nominal, X_TH.translation(), X_TH.rotation().ToQuaternion().wxyz()
        )
        H, g = program(arm, q, nominal, X_TH)
        low, high = velocity_bounds(arm, q)
        assert_minimum(found, H, g, low, high)
        whole, posture = np.zeros((2, MODEL.plant.num_positions()))
        whole[rows], posture[rows] = q, nominal
        bus = BusValue()
        bus.Set(hand_key(arm), Value(RigidTransform(X_TH)))
        system.get_input_port_position().FixValue(context, whole)
        system.get_input_port_nominal_posture().FixValue(context, posture)
        system.get_input_port_desired_cartesian_poses().FixValue(context, Value(bus))
        by_drake = system.get_output_port().Eval(context)
        if np.any((found <= low + 1e-9) | (found >= high - 1e-9)):
            polished.append(np.abs(by_drake - found).max())
        else:  # OSQP is content with a gradient of a thousandth of its terms: eps_rel.
            slope = np.abs(H @ by_drake - g).max()
            assert slope < 1e-3 * max(np.abs(H @ by_drake).max(), np.abs(g).max())
        # OSQP stops early now and then, never below the minimum.
        within = np.clip(by_drake, low, high)
        assert 0.5 * found @ H @ found - g @ found <= 0.5 * within @ H @ within - g @ within + 1e-9
    # With an active bound OSQP polishes its answer, and then both are the same.
    assert len(polished) > 4
    assert np.median(polished) < 1e-7


def test_a_number_that_is_none_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        solve_box_qp(np.eye(5), np.full(5, np.nan), -np.ones(5), np.ones(5))
