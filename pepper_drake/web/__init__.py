"""Pages in the browser: one way to serve them, on which nobody else gets in."""
