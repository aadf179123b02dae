"""Logs and reports: written by runs, read by others."""
