"""Process that serves a Meshcat's page, isolated from the session.

It reads one line of JSON from its standard input, with the address of the Meshcat and the page's
access, answers with a line that contains the port, and ends when its standard input does.
"""

import asyncio
import json
import re
import sys
from typing import Any

from tornado.httpclient import AsyncHTTPClient, HTTPClientError
from tornado.websocket import WebSocketClientConnection, websocket_connect

from pepper_drake.errors import PepperDrakeError
from pepper_drake.web.access import Access
from pepper_drake.web.page_server import Asset, PageServer

_SCENE_LIMIT = 2**30
"""Largest message from Meshcat [bytes]: only our own meshes and recordings."""


async def serve_page(order: dict[str, Any]) -> tuple[int, WebSocketClientConnection]:
    """Starts to serve a Meshcat's page.

    Args:
        order: Fields `meshcat`, the address of the Meshcat; `host`, the address to listen at; and
            `token`, which may be null.

    Returns:
        The port, and the connection to the Meshcat, to be kept while the page is served.
    """
    url = order["meshcat"]

    def tell() -> None:
        print(json.dumps({"opened": True}), flush=True)

    def show(data: bytes | str | None) -> None:
        if isinstance(data, bytes):
            server.broadcast(data)

    server = PageServer(await _assets(url), Access(order["host"], order["token"]), tell)
    upstream = await websocket_connect(
        url.replace("http://", "ws://"),
        on_message_callback=show,
        max_message_size=_SCENE_LIMIT,
    )
    return server.listen(), upstream


async def _assets(url: str) -> dict[str, Asset]:
    """Returns the files of Drake's page by path."""
    page = await _get(url + "/")
    scripts = re.findall(rb'src="([\w/.-]+)"', page.content)
    paths = ["/favicon.ico", *(f"/{script.decode()}" for script in scripts)]
    return {"/": page} | {path: await _get(url + path) for path in paths}


async def _get(url: str) -> Asset:
    answer = await AsyncHTTPClient().fetch(url)
    return Asset(answer.body, answer.headers.get("Content-Type", "application/octet-stream"))


async def main() -> None:
    """Serves until the standard input ends."""
    try:
        port, _upstream = await serve_page(json.loads(sys.stdin.readline()))
        answer: dict[str, Any] = {"port": port}
    except (PepperDrakeError, OSError, HTTPClientError, ValueError) as error:
        answer = {"error": str(error)}
    print(json.dumps(answer), flush=True)
    if "error" not in answer:
        await asyncio.to_thread(sys.stdin.read)


if __name__ == "__main__":
    asyncio.run(main())
