"""The same tasks with other libraries, as their documentation recommends."""

import numpy as np
import pytest

from pepper_drake.learning import Demonstration

INSTALL = "not installed; `.venv/bin/pip install '.[bench]'` adds the peers"


class MovementPrimitivesPeer:
    """movement_primitives' DMP, its Cython Runge-Kutta steps, 40 weights a dimension."""

    def __init__(self, demonstration: Demonstration) -> None:
        self._dmp_module = pytest.importorskip(
            "movement_primitives.dmp", reason=f"movement_primitives is {INSTALL}"
        )
        self._demonstration = demonstration
        self._dmp = self.fit()

    def fit(self):
        """Returns a DMP that imitates the demonstration, including its velocities at both ends."""
        demo = self._demonstration
        dmp = self._dmp_module.DMP(3, execution_time=demo.duration, dt=0.01, n_weights_per_dim=40)
        dmp.imitate(demo.times, demo.positions, allow_final_velocity=True)
        dmp.configure(start_yd=demo.velocities[0])
        return dmp

    def rollout(self) -> np.ndarray:
        """Returns positions (N, 3)."""
        return self._dmp.open_loop()[1]

    def rollout_among(self, points: np.ndarray) -> np.ndarray:
        """Returns positions (N, 3) of a rollout with a coupling term for each point."""
        terms = [self._dmp_module.CouplingTermObstacleAvoidance3D(point) for point in points]

        class Sum:
            def coupling(self, y, yd):
                return np.zeros(3), sum(term.coupling(y, yd)[1] for term in terms)

        return self._dmp.open_loop(coupling_term=Sum())[1]


class ProDmpPeer:
    """ProDMP of mp_pytorch: 40 basis functions, one thread, double precision."""

    def __init__(self, demonstration: Demonstration) -> None:
        mp = pytest.importorskip("mp_pytorch.mp", reason=f"mp_pytorch is {INSTALL}")
        self._torch = pytest.importorskip("torch", reason=f"torch is {INSTALL}")
        self._torch.set_num_threads(1)
        arguments = {
            "num_basis": 40,
            "basis_bandwidth_factor": 2,
            "num_basis_outside": 0,
            "alpha": 25.0,
            "alpha_phase": 3.0,
            "dt": 0.01,
            "auto_scale_basis": True,
            "relative_goal": True,
        }
        self._prodmp = mp.MPFactory.init_mp(
            "prodmp", arguments, 3, demonstration.duration, dtype=self._torch.float64
        )
        self._times = self._torch.as_tensor(demonstration.times)[None]
        self._positions = self._torch.as_tensor(demonstration.positions)[None]
        self._start_velocity = self._torch.as_tensor(demonstration.velocities[:1])
        self._weights = self.fit()

    def fit(self):
        """Returns weights and goal (1, 3 * 41)."""
        return self._prodmp.learn_mp_params_from_trajs(
            self._times,
            self._positions,
            init_time=self._times[:, 0],
            init_pos=self._positions[:, 0],
            init_vel=self._start_velocity,
        )["params"]

    def perturbed(self, count: int):
        """Returns weights (count, 3 * 41) near those learned."""
        generator = self._torch.Generator().manual_seed(0)
        shape = (count, self._weights.shape[1])
        noise = self._torch.randn(shape, generator=generator, dtype=self._torch.float64)
        return self._weights + 0.01 * noise

    def rollout(self, weights=None) -> np.ndarray:
        """Returns positions (S, N, 3) for weights (S, 3 * 41); velocities are computed, too."""
        weights = self._weights if weights is None else weights
        count = len(weights)
        self._prodmp.clear_computation_result()
        self._prodmp.update_inputs(
            times=self._times.expand(count, -1),
            params=weights,
            init_time=self._times[:, 0].expand(count),
            init_pos=self._positions[:, 0].expand(count, -1),
            init_vel=self._start_velocity.expand(count, -1),
        )
        self._prodmp.get_traj_vel()
        return self._prodmp.get_traj_pos().numpy()
