"""Web pages and their secured server."""
