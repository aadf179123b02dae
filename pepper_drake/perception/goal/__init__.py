"""The goal object: marker detection and the filter of its pose."""
