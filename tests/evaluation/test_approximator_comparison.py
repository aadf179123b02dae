import dataclasses

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.evaluation.approximator_comparison import (
    ComparisonRow,
    compare,
    distances,
    markdown_table,
    strengths,
    trajectory_distance,
)
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.demonstration_folder import load_all
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations


def test_distance_worked_by_hand():
    # Errors 3 and 4 in x, none in y, 2 in z: (5 + 0 + 2) / 3.
    shown = np.zeros((2, 3))
    performed = np.array([[3.0, 0.0, 2.0], [4.0, 0.0, 0.0]])
    assert trajectory_distance(shown, performed) == pytest.approx(7 / 3)


def test_distance_is_taken_at_the_demonstration_s_own_times():
    demonstration = example_demonstrations(1)[0]
    primitive = MovementPrimitive.fit(demonstration)
    exact = primitive.rollout(time_step=0.01)
    coarse = primitive.rollout(time_step=0.03)
    # The samples between are those of a cubic: off by less than a tenth of a millimetre.
    assert distances(demonstration, coarse)[0] == pytest.approx(
        distances(demonstration, exact)[0], abs=1e-3
    )


def test_rows_are_means_and_medians_over_the_demonstrations():
    demonstrations = example_demonstrations(3)
    calls = []
    (row,) = compare(demonstrations, ["lwr"], [20], progress=lambda: calls.append(1))
    single = [compare([d], ["lwr"], [20])[0].position_distance for d in demonstrations]
    assert len(calls) == 3
    assert row.demonstrations == 3
    assert row.position_distance == pytest.approx(np.mean(single))
    assert row.position_distance_median == pytest.approx(np.median(single))
    assert row.fit_seconds > 0
    assert row.rollout_seconds > 0


def test_more_basis_functions_come_closer():
    rows = compare(example_demonstrations(3), ["lwr", "rbfn"], [20, 60])
    assert rows[1].position_distance < 0.5 * rows[0].position_distance
    assert rows[3].position_distance < 0.5 * rows[2].position_distance


def test_markdown_has_a_line_for_every_row():
    rows = compare(example_demonstrations(1), ["lwr"], [20, 30])
    lines = markdown_table(rows).splitlines()
    assert len([line for line in lines if line.startswith("| lwr |")]) == 2


def test_examples_are_what_they_say():
    for index, demo in enumerate(example_demonstrations(4)):
        assert 2 <= demo.duration <= 5
        assert np.ptp(demo.positions, axis=0).max() <= 0.2501
        slopes = np.gradient(demo.positions, demo.times, axis=0)[2:-2]
        np.testing.assert_allclose(slopes, demo.velocities[2:-2], atol=5e-3)
        at_rest = np.linalg.norm(demo.velocities[[0, -1]], axis=1) < 1e-9
        assert at_rest.all() == (index % 2 == 0)


def test_a_folder_gives_all_its_demonstrations_and_nothing_else(tmp_path):
    first, second, third = example_demonstrations(3)
    turned = dataclasses.replace(first, rotations=np.tile([1.0, 0, 0, 0], (len(first.times), 1)))
    turned.save(tmp_path / "a.txt")  # With a_pose.txt beside it, which is no motion of its own.
    second.save(tmp_path / "deeper" / "b")
    turned.save(tmp_path / "alone_pose.txt")
    (tmp_path / "LICENSES.txt").write_text("Do with it what you like.\n")
    (tmp_path / "empty.txt").write_text("# nothing\n")
    found = load_all([tmp_path])
    assert [demo.name for demo in found] == ["a", "alone", "b"]
    np.testing.assert_array_equal(found[2].positions, second.positions)
    third.save(tmp_path / "c.txt")
    assert isinstance(load_all([tmp_path / "c.txt", tmp_path / "deeper"])[1], Demonstration)


def test_a_folder_without_demonstrations_is_refused(tmp_path):
    (tmp_path / "note.txt").write_text("nothing here\n")
    with pytest.raises(InputError, match="no demonstration in or below"):
        load_all([tmp_path])


def test_a_broken_demonstration_is_named(tmp_path):
    (tmp_path / "bad.txt").write_text("0 1 2 3\n0.1 1 2 oops\n")
    with pytest.raises(InputError, match=r"bad\.txt, line 2"):
        load_all([tmp_path])


def test_strengths_tell_the_measured_best_of_all_rows():
    def row(name, num_basis, position, velocity, seconds):
        return ComparisonRow(name, num_basis, 1, 9.0, 9.0, position, velocity, seconds, 0.1)

    lines = strengths(
        [
            row("lwr", 20, 0.02, 0.5, 0.001),
            row("lwr", 40, 0.01, 0.4, 0.002),
            row("mine.py:own", 40, 0.001, 0.6, 0.1),
        ]
    )
    (lwr,) = [line for line in lines if line.split()[0] == "lwr"]
    (own,) = [line for line in lines if line.split()[0] == "mine.py:own"]
    assert " 10 mm" in lwr
    assert "with 40" in lwr
    assert "best velocities; quickest to fit; the report's" in lwr
    assert own.endswith("most accurate")
