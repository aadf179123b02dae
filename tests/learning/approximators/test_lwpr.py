import numpy as np
import pytest

from pepper_drake.learning.approximators.lwpr import Lwpr, LwprParameters


def show(learner, inputs, function, epochs, seed=0):
    rng = np.random.default_rng(seed)
    for _ in range(epochs):
        for x in rng.permutation(inputs):
            learner.update(np.array([x]), function(x)[None])


def show_one(learner, x, y):
    learner.update(np.array([x]), y[None])


def weighted_line(inputs, outputs, centre, root):
    """Returns value and slope at the weighted mean of a field's regression, and that mean."""
    w = np.exp(-0.5 * (root * (inputs - centre)) ** 2)
    slope, offset = np.polyfit(inputs, outputs, 1, w=np.sqrt(w))
    mean = np.average(inputs, weights=w)
    return slope * mean + offset, slope, mean


def test_sums_after_two_samples_worked_by_hand():
    # A field at 0 of width 1, without forgetting: first (0, 1), which makes it, then (0, 1) again
    # with weight 1, then (1, 3) with weight w = exp(-1/2).
    parameters = LwprParameters(
        initial_forgetting=1.0, final_forgetting=1.0, learning_rate=0.0, generation_threshold=0.1
    )
    learner = Lwpr(1, 1.0, parameters)
    show_one(learner, 0.0, np.array([1.0]))
    show_one(learner, 0.0, np.array([1.0]))
    show_one(learner, 1.0, np.array([3.0]))
    w = np.exp(-0.5)
    field = learner.fields[0]
    mean = w / (1 + w)
    assert field["weight"] == pytest.approx(1 + w)
    assert field["mean_x"] == pytest.approx(mean)
    assert field["mean_y"][0] == pytest.approx(1 + 2 * mean)
    assert field["ss"] == pytest.approx(w * (1 - mean) ** 2, rel=1e-6)
    assert field["sr"][0] == pytest.approx(w * (1 - mean) * (2 - 2 * mean))
    # The error of the old model, a constant: what is left of 3 after the new mean.
    assert field["cost"] == pytest.approx(w * (2 - 2 * mean) ** 2)


def test_each_field_is_the_weighted_regression_of_its_data():
    parameters = LwprParameters(
        initial_forgetting=0.9999, final_forgetting=0.9999, learning_rate=0.0
    )
    learner = Lwpr(1, 0.1, parameters)
    inputs = np.linspace(0, 1, 200)
    show(learner, inputs, lambda x: np.array([np.sin(5 * x)]), epochs=20)
    for field in learner.trusted_fields():
        value, slope, mean = weighted_line(
            inputs, np.sin(5 * inputs), field["centre"], field["root"]
        )
        assert field["mean_x"] == pytest.approx(mean, abs=2e-3)
        assert field["mean_y"][0] == pytest.approx(value, abs=1e-2)
        assert field["sr"][0] / field["ss"] == pytest.approx(slope, abs=3e-2)


def test_fields_are_added_until_every_sample_activates_one():
    learner = Lwpr(1, 0.05, LwprParameters(learning_rate=0.0))
    inputs = np.linspace(0, 1, 300)
    show(learner, inputs, lambda x: np.array([x]), epochs=1)
    nearest = np.abs(inputs[:, None] - learner.fields["centre"]).min(axis=1)
    reach = 0.05 * np.sqrt(-2 * np.log(0.3))
    assert nearest.max() <= reach
    assert np.diff(np.sort(learner.fields["centre"])).min() > reach * (1 - 1e-9)


def test_metric_narrows_where_the_function_bends_and_widens_where_it_is_straight():
    learner = Lwpr(1, 0.1, LwprParameters(pruning_threshold=2.0, penalty=1e-4))
    inputs = np.linspace(0, 1, 200)
    show(learner, inputs, lambda x: np.array([np.sin(15 * max(x - 0.5, 0)) + x]), epochs=20)
    fields = learner.trusted_fields()
    straight = fields["root"][fields["centre"] < 0.2]
    bent = fields["root"][fields["centre"] > 0.6]
    assert straight.max() < 10.0 < bent.min()  # 10 is what all began with.


def test_metric_follows_the_gradient_of_the_leave_one_out_cost():
    # With a rate too small to move, the accumulated step is the gradient of log J, which central
    # differences of the batch cost give as well.
    inputs = np.linspace(-1, 1, 201)
    outputs = np.sin(4 * inputs) + inputs**2
    width, rate, epochs = 0.3, 1e-9, 40
    parameters = LwprParameters(
        learning_rate=rate,
        generation_threshold=1e-9,
        initial_forgetting=0.9999,
        final_forgetting=0.9999,
        penalty=0.0,
    )
    learner = Lwpr(1, width, parameters)
    learner.update(np.zeros(1), outputs[100:101, None])
    rng = np.random.default_rng(0)
    roots = []
    for _ in range(epochs):
        roots.append(learner.fields["root"][0])
        for index in rng.permutation(len(inputs)):
            learner.update(inputs[index : index + 1], outputs[index : index + 1, None])
    samples = len(roots) // 2
    measured = -np.log(roots[-1] / roots[samples]) / rate

    def log_cost(root):
        w = np.exp(-0.5 * (root * inputs) ** 2)
        value, slope, mean = weighted_line(inputs, outputs, 0.0, root)
        s = inputs - mean
        error = outputs - value - slope * s
        leave_one_out = error / (1 - w * s**2 / np.sum(w * s**2))
        return np.log(np.sum(w * leave_one_out**2) / np.sum(w))

    step = 1e-4
    gradient = (log_cost((1 + step) / width) - log_cost((1 - step) / width)) / (2 * step)
    # Each update is divided by the sum of weights, about that of 1 / (1 - 0.9999) samples.
    per_epoch = np.sum(np.exp(-0.5 * (inputs / width) ** 2))
    memory = 1 - 0.9999 ** (len(inputs) * np.arange(samples, epochs - 1))
    expected = gradient * np.sum(per_epoch / (per_epoch / len(inputs) / 1e-4 * memory))
    assert gradient < -0.5
    assert measured == pytest.approx(expected, rel=0.2)


def test_of_two_fields_that_answer_alike_the_narrower_goes():
    learner = Lwpr(1, 0.1)
    show_one(learner, 0.0, np.zeros(1))
    show_one(learner, 0.3, np.zeros(1))
    assert learner.num_added == 2
    learner.fields["root"] = [1.0, 0.5]
    show_one(learner, 0.15, np.zeros(1))
    assert learner.num_pruned == 1
    assert learner.fields["centre"].tolist() == [0.3]


def test_outputs_share_fields_and_are_predicted_together():
    learner = Lwpr(2, 0.05)
    inputs = np.linspace(0, 1, 200)
    show(learner, inputs, lambda x: np.array([np.sin(6 * x), np.cos(6 * x)]), epochs=15)
    expected = np.column_stack([np.sin(6 * inputs), np.cos(6 * inputs)])
    np.testing.assert_allclose(learner.predict(inputs), expected, atol=0.04)


def test_distant_samples_together_are_the_same_as_one_after_the_other():
    together, in_turn = Lwpr(1, 0.01), Lwpr(1, 0.01)
    inputs = np.linspace(0, 1, 200)
    rng = np.random.default_rng(0)
    for first in np.tile(rng.permutation(50), 4):
        chosen = inputs[first::50]
        outputs = np.sin(9 * chosen)[:, None]
        together.update(chosen, outputs)
        for x, y in zip(chosen, outputs, strict=True):
            show_one(in_turn, x, y)
    np.testing.assert_allclose(together.predict(inputs), in_turn.predict(inputs), rtol=1e-9)
