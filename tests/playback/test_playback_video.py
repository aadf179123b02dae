from dataclasses import replace

import cv2
import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.playback.bodies import replay_frames
from pepper_drake.playback.loading import load_motion
from pepper_drake.playback.video import write_video


def frames_in(path):
    film = cv2.VideoCapture(str(path))
    frames = []
    while (read := film.read())[0]:
        frames.append(read[1])
    return frames


def brief(run, count):
    """The last frames of a run."""
    frames = replay_frames(load_motion(run))
    return replace(frames, times=frames.times[:count], clock=frames.clock[-count:])


@pytest.mark.render
def test_runs_are_filmed_side_by_side_until_the_longest_ends(runs, tmp_path):
    path = tmp_path / "films" / "two.mp4"
    write_video([brief(runs[0], 1), brief(runs[1], 2)], path)
    frames = frames_in(path)
    assert len(frames) == 2
    assert frames[0].shape == (480, 1280, 3)
    left, right = frames[0][:, :640].astype(float), frames[0][:, 640:].astype(float)
    assert left.std() > 20, "there is something to see"
    orange = (right[..., 2] > 180) & (right[..., 0] < 90)
    blue = (left[..., 0] > 140) & (left[..., 2] < 90)
    assert np.count_nonzero(orange) > 30, "the way of the second run's hand"
    assert np.count_nonzero(blue) > 30, "the way of the first run's hand"


@pytest.mark.render
def test_a_demonstration_is_filmed_without_a_scene(tmp_path):
    from pepper_drake.models.pepper import MODELS_DIR

    write_video([brief(MODELS_DIR / "demonstrations" / "reach", 1)], tmp_path / "demo.mp4")
    (frame,) = frames_in(tmp_path / "demo.mp4")
    assert frame.shape == (600, 960, 3)
    assert frame.std() > 20


def test_a_film_that_cannot_be_written_is_named(runs, tmp_path):
    with pytest.raises(InputError, match=r'"film\.avi"; it must end in \.mp4 or \.gif'):
        write_video([brief(runs[0], 1)], tmp_path / "film.avi")
    (tmp_path / "folder.mp4").mkdir()
    with pytest.raises(InputError, match="cannot be written; choose another --output"):
        write_video([brief(runs[0], 1)], tmp_path / "folder.mp4")
