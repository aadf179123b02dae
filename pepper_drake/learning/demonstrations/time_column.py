"""The times of a file's samples: their unit, the clock that they are of, their order."""

from dataclasses import replace

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.importers.options import TIMES, ImportOptions
from pepper_drake.learning.demonstrations.importers.track import Track

_EPOCHS = (("ns", 9e17, 4.2e18), ("us", 9e14, 4.2e15), ("ms", 9e11, 4.2e12))
"""Ranges of clocks of the years 1998 to 2103 in units below the second."""

_FEWEST = 4
"""Smallest number of samples."""


def with_times(track: Track, options: ImportOptions, notes: list[str]) -> Track:
    """Returns the track with times in seconds.

    Args:
        track: As read from a file.
        options: What the user states.
        notes: A note on what was assumed is added.

    Raises:
        InputError: The times are not known, or are no times.
    """
    times = track.times
    if track.num_samples < _FEWEST:
        raise InputError(f"{track.path}: {track.num_samples} samples; a motion needs at least 4")
    if times is None:
        if options.rate is None:
            raise InputError(
                f"{track.path}: no times in it; name their column time, or say the samples a second"
                " (--rate HZ)"
            )
        return replace(track, times=np.arange(track.num_samples) / options.rate, time_unit="s")
    if options.rate is not None:
        notes.append(f"times are those of {options.rate:g} samples a second, as given")
        return replace(track, times=np.arange(len(times)) / options.rate, time_unit="s")
    unit = options.time or track.time_unit
    if unit is None:
        for name, least, most in _EPOCHS:
            if least < times[0] < most:
                unit = name
                notes.append(f"times are a clock's in {name}: no other unit gives a date")
        counted = len(times) >= 20 and bool(np.all(np.diff(times) == 1.0))
        if unit is None and counted and float(times[0]).is_integer():
            raise InputError(
                f"{track.path}: the first column counts the samples and is not a time in seconds;"
                " say the samples a second (--rate HZ), or --time s if they are seconds"
            )
    elif options.time is not None and track.time_unit not in (None, options.time):
        notes.append(f"times in {options.time}, as given; the file says {track.time_unit}")
    seconds = (times - times[0] if abs(times[0]) > 1e5 else times) * TIMES[unit or "s"]
    return replace(track, times=seconds, time_unit=unit)


def refuse_order(track: Track) -> None:
    """Refuses times that do not increase from sample to sample."""
    assert track.times is not None
    back = np.flatnonzero(np.diff(track.times) <= 0.0)
    if len(back):
        k = int(back[0])
        mend = "remove one of them, or say --rate HZ where the samples are even"
        if track.times[k + 1] < track.times[k]:
            mend = (
                "are there two recordings in it? Cut it there; if only the clock began anew, say"
                " --rate HZ"
            )
        raise InputError(
            f"{track.where(k + 1)}: time {track.times[k + 1]:.10g} s does not come after"
            f" {track.times[k]:.10g} s; rows must be in order of time, each time once ({mend})"
        )
