"""Who uses a meshcat page: its websocket protocol, and a real browser where there is one."""

import asyncio
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

import umsgpack
from tornado.websocket import websocket_connect

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_KEYS = {
    "ArrowUp": 38,
    "KeyR": 82,
    "Space": 32,
}


def find_browser():
    """Returns the path of a browser of the Chromium family, or None."""
    return next(filter(None, map(shutil.which, _BROWSERS)), None)


class Loop:
    """Runs what is asynchronous to its end."""

    def __init__(self):
        self._loop = asyncio.new_event_loop()

    def run(self, function, *arguments, **options):
        async def call():
            return await function(*arguments, **options)

        return self._loop.run_until_complete(call())

    def close(self):
        self.run(asyncio.sleep, 0)
        self._loop.close()


class ProtocolClient:
    """Says what the page's script would say, over the page's own websocket."""

    def __init__(self, drake_page):
        self._loop = Loop()
        self._socket = self._loop.run(websocket_connect, drake_page.ws_url)

    def close(self):
        async def close():
            self._socket.close()  # It looks for the loop that runs.

        self._loop.run(close)
        self._loop.close()

    def press(self, label):
        self._send({"type": "button", "name": label})

    def slide(self, label, value):
        self._send({"type": "slider", "name": label, "value": value})

    def pad(self, axes, buttons):
        pad = {"index": 0, "axes": axes, "button_values": buttons}
        self._send({"type": "gamepad", "name": "", "gamepad": pad})

    def _send(self, message):
        self._loop.run(self._socket.write_message, umsgpack.packb(message), binary=True)


class BrowserClient:
    """A headless browser with the page open, driven over its debugging protocol."""

    def __init__(self, url):
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [
                find_browser(),
                "--headless=new",
                "--no-sandbox",
                "--disable-dev-shm-usage",
                "--use-gl=angle",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--window-size=1400,900",
                "--remote-debugging-port=0",
                f"--user-data-dir={self._folder.name}",
                url,
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._loop, self._number = Loop(), 0
        try:
            port = self._wait_for(self._port, "the browser to start")
            page = self._wait_for(lambda: self._page(port, url), "its page")
            self._socket = self._loop.run(websocket_connect, page, max_message_size=1 << 28)
        except BaseException:
            self._process.kill()
            raise

    def close(self):
        self._socket.close()
        self._loop.close()
        self._process.terminate()
        self._process.wait(10)
        self._folder.cleanup()

    def key(self, code):
        key = {"code": code, "key": code, "windowsVirtualKeyCode": _KEYS[code]}
        for kind in ("rawKeyDown", "keyUp"):
            self.command("Input.dispatchKeyEvent", type=kind, **key)

    def click(self, label):
        """Clicks in the middle of the control with a label."""
        box = self.evaluate(
            "(() => { const row = [...document.querySelectorAll('.dg .cr')].find("
            f"row => row.innerText.startsWith({json.dumps(label)}));"
            "const box = row.getBoundingClientRect();"
            "return [box.x + box.width / 2, box.y + box.height / 2]; })()"
        )
        where = {"x": box[0], "y": box[1], "button": "left", "clickCount": 1}
        for kind in ("mousePressed", "mouseReleased"):
            self.command("Input.dispatchMouseEvent", type=kind, **where)

    def evaluate(self, script):
        answer = self.command("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def command(self, method, **arguments):
        self._number += 1
        message = {"id": self._number, "method": method, "params": arguments}
        self._loop.run(self._socket.write_message, json.dumps(message))
        while True:
            answer = json.loads(self._loop.run(self._socket.read_message))
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def _port(self):
        file = Path(self._folder.name) / "DevToolsActivePort"
        return int(file.read_text().splitlines()[0]) if file.exists() else None

    def _page(self, port, url):
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = json.loads(answer.read())
        found = [page for page in pages if page["type"] == "page" and page["url"].startswith(url)]
        return found[0]["webSocketDebuggerUrl"] if found else None

    def _wait_for(self, look, what):
        end = time.monotonic() + 30
        while time.monotonic() < end:
            found = look()
            if found:
                return found
            time.sleep(0.05)
        raise TimeoutError(f"waited for {what}")
