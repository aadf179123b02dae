from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pepper_drake.planning.reach.hanging_things import hanging_things
from pepper_drake.planning.trajectories.retreat import NewObstacleParams
from tests.planning.reach.planner_setup import ORIGIN, TABLE, object_at, observed

PARAMS = NewObstacleParams()
X_WO = object_at(z=0.735)
ARM = X_WO.translation() + np.array([[0.1, 0.1 + 0.02 * k, 0.2] for k in range(20)])
FAR = X_WO.translation() + np.array([[0.0, 0.7 + 0.02 * k, 0.2] for k in range(20)])


def space(hidden):
    """Space in which all but what is asked to be carried hangs, and one end of some is hidden."""
    return SimpleNamespace(
        views=[],
        hanging=lambda cloud, *_: np.ones(len(cloud), dtype=bool),
        end_hidden=lambda hanging, *_: np.full(len(hanging), hidden),
    )


@pytest.mark.parametrize("hidden", [True, False])
def test_what_carries_the_goal_object_does_not_hang_nor_counts_what_is_far_from_it(hidden):
    seen = observed(ORIGIN, X_WO, np.concatenate((TABLE, ARM, FAR)))
    seen = replace(seen, space=space(hidden))
    found = hanging_things(seen, PARAMS)
    assert 10 < len(found.all) <= len(ARM)
    assert np.isin(found.all, ARM).all()
    np.testing.assert_array_equal(found.coming, found.all[: len(found.all) if hidden else 0])


def test_without_a_map_of_seen_space_nothing_is_known_to_hang():
    found = hanging_things(observed(ORIGIN, X_WO, ARM), PARAMS)
    assert found.all.shape == found.coming.shape == (0, 3)
