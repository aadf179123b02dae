"""A tutor's scores of reproductions as a cost: from a file, or typed on request."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import read_text, write_atomically
from pepper_drake.learning import MovementPrimitive
from pepper_drake.optimization.parameters import MovementParameters
from pepper_drake.optimization.problem import Evaluate

Array = npt.NDArray[np.float64]

BEST_SCORE = 10.0
"""Scores go from 0, the worst, to this."""


def rating_cost(scores: npt.ArrayLike) -> Array:
    """Returns costs (S,) of scores (S,): 0 for the best, 1 for the worst."""
    return 1.0 - np.asarray(scores, dtype=float) / BEST_SCORE


@dataclass
class RatingCollector:
    """Shows reproductions and collects scores.

    Each reproduction is saved as a primitive, to be performed, and those of an update are drawn in
    one picture. Scores are in a file, one per line, in the order of the reproductions: existing
    ones are read, typed ones are added, so that none is asked for twice.

    Attributes:
        parameters: Meaning of a sample's numbers.
        folder: Where the reproductions are saved.
        scores: The file of scores.
        draw: Draws reproductions (by number) beside the primitive and saves them as a picture.
        ask: Shows a question and returns the answer; None to take scores from the file only.
        rated: Number of reproductions rated in finished updates.
    """

    parameters: MovementParameters
    folder: Path
    scores: Path
    draw: Callable[[MovementPrimitive, Mapping[int, MovementPrimitive], Path], None]
    ask: Callable[[str], str] | None = None
    rated: int = 0
    _known: list[float] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        """Reads existing scores."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if self.scores.exists() or self.ask is None:
            self._known = load_scores(self.scores)

    def forget(self) -> None:
        """Drops the scores of an earlier search, which were for other reproductions."""
        self._known = []
        self.scores.unlink(missing_ok=True)

    def __call__(self, samples: Array) -> Array:
        """Returns the scores (S,) of reproductions with parameters (S, n).

        Raises:
            InputError: The file has too few scores, and nobody can be asked.
        """
        numbers = range(self.rated + 1, self.rated + len(samples) + 1)
        shown = {
            number: self.parameters.primitive_at(sample)
            for number, sample in zip(numbers, samples, strict=True)
        }
        for number, primitive in shown.items():
            primitive.save(self.folder / f"{number:03d}.yaml")
        picture = self.folder / f"{numbers[0]:03d}_to_{numbers[-1]:03d}.png"
        self.draw(self.parameters.primitive, shown, picture)
        for number in numbers[max(0, len(self._known) - self.rated) :]:
            if self.ask is None:
                raise InputError(
                    f"{self.scores}: {len(self._known)} scores where {numbers[-1]} are needed;"
                    f" rate {self.folder}/{number:03d} to {numbers[-1]:03d} with 0 to"
                    f" {BEST_SCORE:g}, add a line for each, and continue with --resume"
                )
            self._known.append(self._typed(number))
            text = "\n".join(f"{score:g}" for score in self._known)
            write_atomically(self.scores, text + "\n")
        scores = np.array(self._known[numbers[0] - 1 : numbers[-1]])
        self.rated = numbers[-1]
        return scores

    def _typed(self, number: int) -> float:
        assert self.ask is not None
        question = f"{self.folder}/{number:03d}: how good is it, 0 to {BEST_SCORE:g}? "
        while True:
            score = _score(self.ask(question))
            if score is not None:
                return score
            question = f"A number from 0 to {BEST_SCORE:g}, please: "


def rated(evaluate: Evaluate, tutor: RatingCollector, weight: float) -> Evaluate:
    """Returns an evaluator that adds the tutor's rating to another one's costs."""

    def evaluate_and_rate(samples: Array) -> Array:
        costs = np.array(evaluate(samples), dtype=float)
        ratings = weight * rating_cost(tutor(samples))
        if costs.ndim == 1:
            return costs + ratings
        costs[:, -1] += ratings
        return costs

    return evaluate_and_rate


def load_scores(path: Path) -> list[float]:
    """Loads scores, one per line; # starts a comment.

    Raises:
        InputError: With file and line.
    """
    scores = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.partition("#")[0].strip()
        if not words:
            continue
        score = _score(words)
        if score is None:
            raise InputError(
                f"{path}, line {number}: '{words}' is not a score from 0 to {BEST_SCORE:g}"
            )
        scores.append(score)
    return scores


def _score(text: str) -> float | None:
    try:
        score = float(text)
    except ValueError:
        return None
    return score if 0.0 <= score <= BEST_SCORE else None
