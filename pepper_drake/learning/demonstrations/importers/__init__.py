"""Readers of what other tools record: one small module a format, and one that tells them apart."""

from pepper_drake.learning.demonstrations.importers.detect import read_tracks
from pepper_drake.learning.demonstrations.importers.options import ImportOptions
from pepper_drake.learning.demonstrations.importers.track import Track

__all__ = ["ImportOptions", "Track", "read_tracks"]
