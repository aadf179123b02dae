import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.optimization import all_weights
from pepper_drake.optimization.ratings import RatingCollector, load_scores, rated, rating_cost
from pepper_drake.reporting.optimization_figures import save_reproductions


@pytest.fixture
def make_tutor(primitive, tmp_path):
    def make(**more):
        return RatingCollector(
            all_weights(primitive),
            tmp_path / "shown",
            tmp_path / "scores.txt",
            save_reproductions,
            **more,
        )

    return make


@pytest.fixture
def samples(primitive):
    size = all_weights(primitive).size
    return 0.01 * np.random.default_rng(0).standard_normal((3, size))


def test_the_best_score_costs_nothing():
    assert rating_cost([10.0, 5.0, 0.0]).tolist() == [0.0, 0.5, 1.0]


def test_scores_are_typed_kept_and_not_asked_for_twice(make_tutor, samples, tmp_path, primitive):
    answers = iter(["7", "good", "11", "8.5", "0"])
    questions = []
    tutor = make_tutor(ask=lambda question: questions.append(question) or next(answers))
    assert tutor(samples).tolist() == [7.0, 8.5, 0.0]
    assert sum("how good is it, 0 to 10?" in question for question in questions) == 3
    assert questions.count("A number from 0 to 10, please: ") == 2
    assert load_scores(tmp_path / "scores.txt") == [7.0, 8.5, 0.0]
    assert (tmp_path / "shown" / "001_to_003.png").stat().st_size > 5000
    shown = MovementPrimitive.load(tmp_path / "shown" / "002.yaml")
    assert shown.goal == pytest.approx(primitive.goal + samples[1, -3:])

    def nobody(question):
        raise AssertionError

    assert make_tutor(ask=nobody)(samples).tolist() == [7.0, 8.5, 0.0]
    later = make_tutor(ask=lambda question: "3", rated=3)
    assert later(samples[:1]).tolist() == [3.0]
    later.forget()
    assert not (tmp_path / "scores.txt").exists()


def test_an_interrupted_tutor_is_asked_for_the_rest(make_tutor, samples):
    answers = iter(["7"])

    def leaves(question):
        try:
            return next(answers)
        except StopIteration:
            raise KeyboardInterrupt from None

    with pytest.raises(KeyboardInterrupt):
        make_tutor(ask=leaves)(samples)
    rest = iter(["1", "2"])
    assert make_tutor(ask=lambda question: next(rest))(samples).tolist() == [7.0, 1.0, 2.0]


def test_scores_from_a_file(make_tutor, samples, tmp_path):
    (tmp_path / "scores.txt").write_text("# mine\n1\n2\n3\n4\n")
    tutor = make_tutor()
    assert tutor(samples).tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match=r"4 scores where 6 are needed; rate .*005 to 006 with"):
        tutor(samples)
    assert (tmp_path / "shown" / "006.yaml").exists()
    (tmp_path / "scores.txt").write_text("1\nten\n")
    with pytest.raises(InputError, match="line 2: 'ten' is not a score from 0 to 10"):
        make_tutor()


def test_a_rating_is_added_to_other_costs(make_tutor, samples, tmp_path):
    (tmp_path / "scores.txt").write_text("10\n5\n0\n")
    whole = rated(lambda x: np.ones(len(x)), make_tutor(), 2.0)
    assert whole(samples).tolist() == [1.0, 2.0, 3.0]
    steps = rated(lambda x: np.ones((len(x), 4)), make_tutor(), 2.0)
    assert steps(samples).tolist() == [[1, 1, 1, 1], [1, 1, 1, 2], [1, 1, 1, 3]]
