"""Logs and reports of runs."""
