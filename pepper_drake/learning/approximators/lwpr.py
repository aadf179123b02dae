"""Locally weighted projection regression, learned one sample at a time; the approximator `lwpr`.

Vijayakumar, D'Souza, Schaal, "Incremental Online Learning in High Dimensions", Neural Computation
17 (2005). The input is one number here, the motion's time, so each field needs a single projection
(partial least squares), the input itself.
"""

from dataclasses import dataclass

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.learning.approximators.local_lines import LineBasis, LocalLines
from pepper_drake.learning.approximators.registry import Approximator, Array, ForcingData, register


@dataclass(frozen=True)
class LwprParameters:
    """Parameters of the receptive fields; the paper's symbols in brackets.

    Attributes:
        generation_threshold: A sample that activates no field above this gets its own [w_gen].
        pruning_threshold: Of two fields that a sample activates above this, one goes [w_prune].
        initial_forgetting: Factor on all sums per sample, at first [lambda].
        final_forgetting: Its limit, once early, poor statistics are forgotten.
        forgetting_rate: Share of the distance to `final_forgetting` that is left after a sample.
        learning_rate: Of the distance metric [alpha].
        penalty: Weight of the cost on narrow fields [gamma], for errors in units of the
            outputs' standard deviation and metrics in units of the initial one.
        widest: Largest width of a field, in initial widths. Where a field spans several bends the
            cost falls towards wider fields, which fit their neighbourhood worse still.
    """

    generation_threshold: float = 0.3
    pruning_threshold: float = 0.9
    initial_forgetting: float = 0.99
    final_forgetting: float = 0.9999
    forgetting_rate: float = 0.999
    learning_rate: float = 0.3
    penalty: float = 1e-5
    widest: float = 1.5


_TINY = np.finfo(float).tiny


class Lwpr:
    """A function of one variable: lines in receptive fields, learned one sample at a time.

    Field k with centre c_k and metric D_k = m_k^2 has the activation
    w_k = exp(-D_k (x - c_k)^2 / 2), keeps the weighted sums of a linear regression with forgetting
    (the paper's table 3), and moves m_k down the gradient of the leave-one-out cost (table 4)

        J_k = 1 / W sum_i w_i |e_i|^2 / (1 - w_i s_i^2 / SS)^2 + gamma D_k^2 .

    Two things differ from the paper: all outputs share the fields, as in its authors' code, and
    the step is taken in log m on log J, so that one learning rate suits every scale of the data.

    Attributes:
        fields: One record per field; see `_field_type`.
        num_added: Fields made so far.
        num_pruned: Fields removed so far.
    """

    def __init__(
        self, num_outputs: int, initial_width: float, parameters: LwprParameters | None = None
    ) -> None:
        self.parameters = parameters or LwprParameters()
        self.fields = np.zeros(0, dtype=_field_type(num_outputs))
        self.num_added = 0
        self.num_pruned = 0
        self._initial_root = 1 / initial_width

    def update(self, inputs: Array, outputs: Array) -> None:
        """Updates the model with samples: inputs (B,), outputs (B, num_outputs).

        The paper takes one sample at a time. Several at once give the same, faster, if they are so
        far apart that no field responds to two; otherwise a field learns from the nearest.
        """
        activation = _activation(self.fields, inputs)
        if len(self.fields):
            nearest = activation.argmax(axis=0)
            w = activation[nearest, np.arange(len(nearest))]
            active = np.flatnonzero(w > 1e-3)
            chosen = nearest[active]
            self.fields[active] = self._updated(
                self.fields[active], w[active], inputs[chosen], outputs[chosen]
            )
        self._prune(activation)
        self._add(activation, inputs, outputs)

    def predict(self, inputs: Array) -> Array:
        """Returns the outputs (N, num_outputs) at inputs (N,)."""
        trusted = self.trusted_fields()
        activation = _activation(trusted, inputs)
        deviation = inputs[:, None] - trusted["mean_x"]
        lines = trusted["mean_y"] + deviation[:, :, None] * _slope(trusted)
        total = activation.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("nk,nkd->nd", activation / total, lines))

    def trusted_fields(self) -> np.ndarray:
        """Returns the fields that have seen more than two samples, enough for a line."""
        return self.fields[self.fields["count"] > 2]

    def _updated(self, old: np.ndarray, w: Array, x: Array, y: Array) -> np.ndarray:
        """Returns K fields after a sample each: x (K,), y (K, num_outputs), activations w (K,)."""
        new = old.copy()
        forget = old["forgetting"]
        # Weighted means, and the regression of the residual on the projected input s.
        new["weight"] = forget * old["weight"] + w
        share = w / new["weight"]
        new["mean_x"] += share * (x - old["mean_x"])
        new["mean_y"] += share[:, None] * (y - old["mean_y"])
        s, residual = x - new["mean_x"], y - new["mean_y"]
        error_before = residual - s[:, None] * _slope(old)
        new["ss"] = forget * old["ss"] + w * s**2
        new["sr"] = forget[:, None] * old["sr"] + (w * s)[:, None] * residual
        error = residual - s[:, None] * _slope(new)
        new["count"] = forget * old["count"] + 1
        # The prediction before the update is the leave-one-out prediction.
        squared_before = np.sum(error_before**2, axis=1)
        new["cost"] = forget * old["cost"] + w * squared_before
        # Slows the metric's adaptation while a field's line has not converged.
        ratio = np.sum(error**2, axis=1) / np.maximum(squared_before, _TINY)
        transient = np.minimum(1.0, ratio) ** 4
        step = transient * self._metric_step(new, w, x, s, error, squared_before)
        root = new["root"] * (1 - np.minimum(np.maximum(step, -0.1), 0.1))
        new["root"] = np.maximum(root, self._initial_root / self.parameters.widest)
        # Traces of how earlier samples' errors change when this sample's weight does.
        leverage = w * s**2 / new["ss"]
        damping = transient / np.maximum(1 - leverage, 1e-3)
        new["trace_h"] = (
            forget[:, None] * old["trace_h"] + (w * s * damping)[:, None] * error_before
        )
        new["trace_r"] = forget * old["trace_r"] + w**2 * s**2 * squared_before * damping
        rate = self.parameters.forgetting_rate
        new["forgetting"] = rate * forget + (1 - rate) * self.parameters.final_forgetting
        return new

    def _metric_step(
        self, new: np.ndarray, w: Array, x: Array, s: Array, error: Array, squared_before: Array
    ) -> Array:
        """Returns the step of log m, downwards: the rate times d log J / d log m."""
        parameters, num_outputs = self.parameters, error.shape[1]
        total, root = new["weight"], new["root"]
        p = s / new["ss"]
        dj_dw = (
            -new["cost"] / total**2
            + (
                squared_before
                - 2 * p * np.sum(error * new["trace_h"], axis=1)
                - 2 * p**2 * new["trace_r"]
            )
            / total
        ) / num_outputs
        dw_dlog = -w * (root * (x - new["centre"])) ** 2
        penalty = parameters.penalty * (root / self._initial_root) ** 4
        gradient = dj_dw * dw_dlog + w / total * 4 * penalty
        cost = new["cost"] / (total * num_outputs) + penalty
        return np.asarray(
            parameters.learning_rate * gradient / np.maximum(cost, _TINY) * (new["count"] > 5)
        )

    def _add(self, activation: Array, inputs: Array, outputs: Array) -> None:
        """Adds a field for each sample that activates none, as wide as the nearest one."""
        threshold = self.parameters.generation_threshold
        for sample in np.flatnonzero(activation.max(axis=1, initial=0.0) < threshold):
            field = np.zeros(1, dtype=self.fields.dtype)
            field["centre"] = field["mean_x"] = inputs[sample]
            field["mean_y"] = outputs[sample]
            field["root"] = self._initial_root
            field["ss"] = 1e-10
            field["forgetting"] = self.parameters.initial_forgetting
            around = _activation(self.fields, inputs[sample : sample + 1])[0]
            if around.max(initial=0.0) > 0.1 * threshold:
                field["root"] = self.fields["root"][around.argmax()]
            self.fields = np.concatenate([self.fields, field])
            self.num_added += 1

    def _prune(self, activation: Array) -> None:
        """Removes the narrower of two fields that a sample activates above the threshold."""
        if len(self.fields) < 2:
            return
        second = np.partition(activation, -2, axis=1)[:, -2]
        crowded = np.flatnonzero(second > self.parameters.pruning_threshold)
        if len(crowded):
            pairs = np.argsort(activation[crowded], axis=1)[:, -2:]
            roots = self.fields["root"][pairs]
            narrower = np.unique(pairs[np.arange(len(pairs)), roots.argmax(axis=1)])
            self.fields = np.delete(self.fields, narrower)
            self.num_pruned += len(narrower)


def _field_type(num_outputs: int) -> np.dtype[np.void]:
    """Returns the record of a receptive field; brackets: the paper's symbol."""
    return np.dtype(
        [
            ("centre", float),  # [c]
            ("root", float),  # Square root of the distance metric [M].
            ("weight", float),  # Sum of activations [W].
            ("count", float),  # Samples, with forgetting.
            ("forgetting", float),  # [lambda]
            ("mean_x", float),  # [x_0]
            ("mean_y", float, (num_outputs,)),  # [beta_0]
            ("ss", float),  # Sum of w s^2 [SS].
            ("sr", float, (num_outputs,)),  # Sum of w s residual [SR].
            ("cost", float),  # Sum of w |leave-one-out error|^2 [E].
            ("trace_h", float, (num_outputs,)),  # [H]
            ("trace_r", float),  # [R]
        ]
    )


def _activation(fields: np.ndarray, inputs: Array) -> Array:
    """Returns w, shape (N, K), at inputs (N,)."""
    scaled = fields["root"] * (inputs[:, None] - fields["centre"])
    return np.asarray(np.exp(-0.5 * scaled**2))


def _slope(fields: np.ndarray) -> Array:
    """Returns beta_1 = SR / SS, shape (K, num_outputs)."""
    return np.asarray(fields["sr"] / fields["ss"][:, None])


def fit_lwpr(data: ForcingData, num_basis: int, seed: int, num_epochs: int = 30) -> LocalLines:
    """Learns the forcing term in `num_epochs` passes over the samples, each in random order.

    Args:
        data: Samples of the forcing term.
        num_basis: Sets the initial field width so that about this many cover the motion; the
            algorithm then adapts number and widths (mostly more and narrower).
        seed: Of the order of the samples.
        num_epochs: Number of passes.

    Raises:
        InputError: `num_basis` is less than one.
    """
    if num_basis < 1:
        raise InputError(f"num_basis is {num_basis}; choose 1 or more.")
    centre, scale = data.targets.mean(axis=0), data.targets.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    outputs = (data.targets - centre) / scale
    parameters = LwprParameters()
    # A field covers +- `reach`; fields placed at random cover 0.7476 of a line (Renyi 1958).
    reach = 0.7476 / num_basis
    width = reach / np.sqrt(-2 * np.log(parameters.generation_threshold))
    learner = Lwpr(data.targets.shape[1], width, parameters)
    rng = np.random.default_rng(seed)
    # Samples eight widths apart are learned together: no field responds to two of them.
    order = np.argsort(data.times, kind="stable")
    stride = min(len(order), int(np.ceil(8 * width * len(order))))
    for _ in range(num_epochs):
        for first in rng.permutation(stride):
            together = order[first::stride]
            learner.update(data.times[together], outputs[together])
    fields = learner.trusted_fields()
    slopes = _slope(fields)
    heights = fields["mean_y"] + slopes * (fields["centre"] - fields["mean_x"])[:, None]
    basis = LineBasis(
        data.alpha_x, np.zeros(len(fields)), fields["centre"].copy(), 1 / fields["root"] ** 2
    )
    return LocalLines(basis, np.vstack([heights * scale + centre, slopes * scale]))


register(Approximator("lwpr", fit_lwpr, LocalLines.from_data))
