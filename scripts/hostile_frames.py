"""Send malformed frames to a served robot, while another client calls it.

Frames are random, truncated, oversized, or sent byte by byte. Each may break its own connection
only. The script prints the latencies of the other client's calls and the server's memory, and
exits with 1 if a call failed or the memory grew by more than a tenth.

    python apps/serve_naoqi.py --scene free &
    python scripts/hostile_frames.py --process $! --frames 100000
"""

import argparse
import asyncio
import logging
import random
import sys
import time
from pathlib import Path

import numpy as np

from pepper_drake.naoqi.wire import HEADER, Message, MessageType, decode, encode, read_header

_CAPABILITIES = encode("{sm}", {"ClientServerSocket": True, "MessageFlags": True})
_ACTIONS = (0, 1, 2, 3, 5, 6, 7, 8, 80, 81, 82, 100, 101, 102, 104, 115, 130, 9999)
_BURST = 50
"""Frames per connection, unless the server closes it before."""
_MEMORY_GROWTH = 0.1
"""Allowed relative growth of the memory."""


def main() -> int:
    """Runs the attack."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--port", type=int, default=9559)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--process", type=int, help="process of the server, to see its memory")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    logging.getLogger("asyncio").setLevel(logging.ERROR)  # It logs every closed connection.
    return asyncio.run(_run(options))


async def _run(options: argparse.Namespace) -> int:
    rng = random.Random(options.seed)
    await _attack(
        options.port, rng, options.frames // 10
    )  # Fills caches before the first measurement.
    before = _memory(options.process)
    stop = asyncio.Event()
    calls = asyncio.create_task(_bystander(options.port, stop))
    slow = [asyncio.create_task(_trickle(options.port, stop)) for _ in range(5)]
    begin = time.monotonic()
    sent = await _attack(options.port, rng, options.frames)
    seconds = time.monotonic() - begin
    stop.set()
    latencies, failed = await calls
    await asyncio.gather(*slow)
    await asyncio.sleep(2.0)
    after = _memory(options.process)
    middle, late = 1e3 * np.percentile(latencies, (50, 99))
    print(f"{sent} frames in {seconds:.0f} s, seed {options.seed}")
    print(f"the other client: {len(latencies)} calls, {failed} failed, {middle:.1f} ms, "
          f"99th percentile {late:.1f} ms")  # fmt: skip
    if before:
        print(f"memory of the server: {before:.0f} MB before, {after:.0f} MB after")
    return int(failed > 0 or after > before * (1.0 + _MEMORY_GROWTH))


def _memory(process: int | None) -> float:
    """Returns the resident memory of a process [MB]; 0 if it is not known."""
    if process is None:
        return 0.0
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


async def _attack(port: int, rng: random.Random, frames: int) -> int:
    """Sends frames over successive connections; returns their number."""
    sent = 0
    while sent < frames:
        try:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            await asyncio.sleep(0.05)
            continue
        drain = asyncio.create_task(_discard(reader))
        try:
            if rng.random() < 0.8:
                writer.write(_hello())
            for _ in range(_BURST):
                if drain.done() or sent == frames:
                    break  # The server has closed this connection.
                writer.write(_frame(rng))
                sent += 1
                await asyncio.sleep(0.0005)
            await asyncio.wait_for(writer.drain(), 5.0)
            await asyncio.wait({drain}, timeout=0.02)
        except (ConnectionError, TimeoutError):
            pass
        drain.cancel()
        writer.close()
    return sent


async def _discard(reader: asyncio.StreamReader) -> None:
    try:
        while await reader.read(65536):
            pass
    except ConnectionError:
        pass


async def _trickle(port: int, stop: asyncio.Event) -> None:
    """Sends frames byte by byte."""
    while not stop.is_set():
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        try:
            for byte in _hello():
                writer.write(bytes([byte]))
                await writer.drain()
                await asyncio.sleep(0.05)
                if stop.is_set():
                    break
        except ConnectionError:
            pass
        del reader
        writer.close()


def _hello() -> bytes:
    return Message(MessageType.CALL, 1, 0, 0, 8, _CAPABILITIES).to_bytes()


def _frame(rng: random.Random) -> bytes:
    payload = rng.randbytes(rng.choice((0, 4, 12, 30, 300, 5000)))
    if rng.random() < 0.3:
        payload = encode("(m)", ([[0.5, "HeadYaw"], {"a": None}, "x" * rng.randrange(50)],))
    message = Message(
        rng.randrange(12) if rng.random() < 0.5 else MessageType.CALL,
        rng.randrange(1000),
        rng.randrange(90),
        rng.randrange(4),
        rng.choice(_ACTIONS),
        payload,
        rng.choice((0, 0, 1, 2, 255)),
    )
    data = bytearray(message.to_bytes())
    kind = rng.random()
    if kind < 0.1:
        return bytes(data[: rng.randrange(len(data))])
    if kind < 0.15:
        data[8:12] = rng.choice((2**31, 2**32 - 1, 20 * 2**20)).to_bytes(4, "little")
    elif kind < 0.3:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(data)


async def _bystander(port: int, stop: asyncio.Event) -> tuple[list[float], int]:
    """Calls the directory repeatedly; returns the latencies [s] and the number of failures."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    latencies, failed = [], 0

    async def call(data: bytes) -> bytes:
        writer.write(data)
        message, size = read_header(await reader.readexactly(HEADER.size))
        answer = await reader.readexactly(size)
        if message.type != MessageType.REPLY:
            raise ValueError("no reply")
        return answer

    await call(_hello())
    ask = Message(MessageType.CALL, 2, 1, 1, 108).to_bytes()
    machine = decode("s", await call(ask))
    while not stop.is_set():
        begin = time.monotonic()
        try:
            failed += decode("s", await asyncio.wait_for(call(ask), 10.0)) != machine
        except (ConnectionError, ValueError, TimeoutError, asyncio.IncompleteReadError):
            failed += 1
            break
        latencies.append(time.monotonic() - begin)
        await asyncio.sleep(0.005)
    writer.close()
    return latencies, failed


if __name__ == "__main__":
    sys.exit(main())
