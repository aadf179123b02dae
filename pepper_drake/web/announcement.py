"""Announces a page's address and waits for a browser."""

from typing import Protocol


class Page(Protocol):
    """A page for browsers."""

    url: str

    def wait_for_browser(self) -> None:
        """Waits until a browser has opened it."""


def wait_for_browser(page: Page) -> None:
    """Prints a page's address and waits until a browser has opened it; Ctrl-C ends the program."""
    print(f"Open {page.url} in a browser; it starts then, and Ctrl-C ends it.", flush=True)
    page.wait_for_browser()
