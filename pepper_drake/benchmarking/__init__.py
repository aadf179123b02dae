"""Comparison of reaching methods over many scenes: success, contacts and speed."""
