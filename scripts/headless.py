"""A browser without a window, as the tests and `pictures.py` use it."""

import shutil
from pathlib import Path

from playwright.sync_api import Browser, Playwright, sync_playwright

from pepper_drake.playback.bodies import FRAME_RATE

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--disable-quic"),
)


def launch(playwright: Playwright) -> Browser:
    """Starts a browser that renders without a graphics card."""
    assert CHROMIUM, "there is no browser: apt-get install chromium, as make test does"
    return playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)


def photograph_playback(page: Path, seconds: float, picture: Path) -> None:
    """Takes a picture of a page of `play.py --html` at a moment.

    Args:
        page: The page's file.
        seconds: Time from the start of the playback.
        picture: File to write.
    """
    with sync_playwright() as playwright:
        browser = launch(playwright)
        view = browser.new_page(viewport={"width": 1000, "height": 583})
        view.goto(page.resolve().as_uri())
        slider = view.locator('input[title="time"]')
        slider.wait_for()
        view.keyboard.press("Home")
        frame = round(seconds * FRAME_RATE)
        slider.evaluate(f"(it) => {{ it.value = {frame}; it.oninput(); }}")
        view.wait_for_timeout(1000)  # For drawing.
        view.screenshot(path=picture)
        browser.close()
