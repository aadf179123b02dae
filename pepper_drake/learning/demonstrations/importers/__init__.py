"""Readers of other tools' formats: a module for each, and one that detects the format."""

from pepper_drake.learning.demonstrations.importers.detect import read_tracks
from pepper_drake.learning.demonstrations.importers.options import ImportOptions
from pepper_drake.learning.demonstrations.importers.track import Track

__all__ = ["ImportOptions", "Track", "read_tracks"]
