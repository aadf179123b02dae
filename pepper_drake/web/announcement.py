"""One way to tell where a page is, and to wait until somebody looks."""

from typing import Protocol


class Page(Protocol):
    """A page that browsers open."""

    url: str

    def wait_for_browser(self) -> None:
        """Waits until somebody has opened it."""


def wait_for_browser(page: Page) -> None:
    """Tells a page's address, and waits until somebody has opened it; Ctrl-C ends the program."""
    print(f"Open {page.url} in a browser; it starts then, and Ctrl-C ends it.", flush=True)
    page.wait_for_browser()
