"""The goal object: marker detection and pose filter."""
