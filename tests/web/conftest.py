import asyncio
import threading
import time

import msgpack
import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect


class Browser:
    """A websocket to a page, with the headers that one likes."""

    def __init__(self, url, **headers):
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.told = []
        self.is_closed = False
        self._socket = self._run(self._connect(url, headers))

    async def _connect(self, url, headers):
        return await websocket_connect(
            HTTPRequest(url, headers={k.replace("_", "-"): v for k, v in headers.items()}),
            on_message_callback=self._hear,
            max_message_size=1 << 28,
        )

    def _hear(self, data):
        if data is None:
            self.is_closed = True
        else:
            self.told.append(msgpack.unpackb(data))

    def send(self, message):
        binary = not isinstance(message, str)
        data = msgpack.packb(message) if isinstance(message, dict) else message

        async def write():
            await self._socket.write_message(data, binary=binary)

        self._run(write())

    @property
    def code(self):
        return self._socket.close_code

    def close(self):
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._socket.close)
            wait_for(lambda: self.is_closed)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    def _run(self, work):
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(10)


def wait_for(look):
    end = time.monotonic() + 10
    while time.monotonic() < end:
        if look():
            return
        time.sleep(0.005)
    raise TimeoutError


@pytest.fixture
def waiting():
    return wait_for


@pytest.fixture
def open_browser():
    """Returns a function that opens a page's websocket."""
    opened = []

    def open_one(url, **headers):
        opened.append(Browser(url, **headers))
        return opened[-1]

    yield open_one
    for browser in opened:
        browser.close()
