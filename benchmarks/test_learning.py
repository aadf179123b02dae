"""Durations of learning and rollouts, compared with other libraries: `make speed`."""

import numpy as np
import pytest
from peers import MovementPrimitivesPeer, ProDmpPeer

from pepper_drake.evaluation.approximator_comparison import trajectory_distance
from pepper_drake.learning import MovementPrimitive


@pytest.fixture(scope="session")
def movement_primitives(demonstration):
    return MovementPrimitivesPeer(demonstration)


@pytest.fixture(scope="session")
def prodmp(demonstration):
    return ProDmpPeer(demonstration)


@pytest.fixture(scope="session")
def perturbed(primitive):
    noise = np.random.default_rng(0).standard_normal((100, *primitive.weights.shape))
    return primitive.weights * (1 + 0.01 * noise)


@pytest.mark.benchmark(group="fit, 501 samples, 40 basis functions")
class TestFit:
    def test_default(self, measure, demonstration):
        measure("fit", lambda: MovementPrimitive.fit(demonstration))

    @pytest.mark.parametrize("name", ["lwr", "lwr_slopes", "rbfn", "trajectory", "gmr", "lwpr"])
    def test_other(self, measure, demonstration, name):
        measure(f"fit/{name}", lambda: MovementPrimitive.fit(demonstration, approximator=name))

    def test_movement_primitives(self, measure, movement_primitives):
        measure("fit/movement_primitives", movement_primitives.fit)

    def test_prodmp(self, measure, prodmp):
        measure("fit/prodmp", prodmp.fit)


@pytest.mark.benchmark(group="rollout, 500 steps, basis cached")
class TestRollout:
    def test_default(self, measure, benchmark, demonstration, primitive):
        path = measure("rollout", primitive.rollout)
        distance = trajectory_distance(demonstration.positions, path.positions)
        benchmark.extra_info["position_distance"] = distance

    def test_movement_primitives(self, measure, benchmark, demonstration, movement_primitives):
        path = measure("rollout/movement_primitives", movement_primitives.rollout)
        distance = trajectory_distance(demonstration.positions, path[: len(demonstration.times)])
        benchmark.extra_info["position_distance"] = distance

    def test_prodmp(self, measure, benchmark, demonstration, prodmp):
        path = measure("rollout/prodmp", prodmp.rollout)
        distance = trajectory_distance(demonstration.positions, path[0])
        benchmark.extra_info["position_distance"] = distance


@pytest.mark.benchmark(group="100 rollouts with perturbed weights")
class TestBatch:
    def test_default(self, measure, primitive, perturbed):
        measure("batch", lambda: primitive.rollout_batch(perturbed))

    def test_prodmp(self, measure, prodmp):
        weights = prodmp.perturbed(100)
        measure("batch/prodmp", lambda: prodmp.rollout(weights))


@pytest.mark.benchmark(group="rollout among points, 500 steps, the cloud given as points")
class TestAmongPoints:
    @pytest.mark.parametrize("count", [250, 1000, 4000])
    def test_barrier(self, measure, primitive, make_cloud, count):
        cloud = make_cloud(count)
        measure(f"among {count}", lambda: primitive.rollout(obstacles=cloud))

    def test_report(self, measure, primitive, make_cloud):
        cloud = make_cloud(1000)
        measure("report among 1000", lambda: primitive.rollout(obstacles=cloud, coupling="report"))

    def test_100_rollouts_at_once(self, measure, primitive, perturbed, make_cloud):
        cloud = make_cloud(1000)
        measure(
            "batch among 1000",
            lambda: primitive.rollout_batch(perturbed, obstacles=cloud),
            rounds=3,
        )

    def test_movement_primitives_among_20_points_only(
        self, measure, movement_primitives, make_cloud
    ):
        cloud = make_cloud(1000)[::50]
        measure(
            "movement_primitives among 20",
            lambda: movement_primitives.rollout_among(cloud),
            rounds=2,
        )
