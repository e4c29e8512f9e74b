"""A crowd in front of one viewer: `python -m tests.endurance.crowd`.

`poise view` is looked at by many clients of viser's protocol. One of them stops reading, one sends
a message of 100 MB, one comes from another's page. The bars: the viewer lives; the stranger and the
message are refused; what the first client is shown goes at 0.95 of real time or more; the viewer's
memory does not grow by what the one that stopped was not sent.
"""

from __future__ import annotations

import argparse
import asyncio
import re
import socket
import struct
import sys
import time
from pathlib import Path

import viser
import websockets
import zstandard
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from .processes import Running

SHOWN = re.compile(rb"(\d+\.\d\d) s, \*\*")  # the simulated time that stands above the controls
REAL_TIME, GROWTH = 0.95, 100.0  # bars: of what is shown; [MiB]
START, ENDING = 180.0, 5.0  # [s] that a viewer may take to answer; before its end nothing is read
HUGE = 100 * 2**20  # bytes of a message
PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")


def main(arguments: list[str] | None = None) -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--clients", type=int, default=50)
    options.add_argument("--seconds", type=float, default=60.0)
    given = options.parse_args(arguments)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    viewer = Running(["view", "--port", str(port), "--seconds", str(given.seconds)])
    crowd = Crowd(port, viewer.process.pid)
    asyncio.run(crowd.look(given.clients, given.seconds))
    ended = viewer.wait()
    rates = crowd.rates()
    print(f"{given.clients} clients, {given.seconds:g} s; the viewer ended with {ended}:")
    print(viewer.output.strip().splitlines()[-1])
    print(f"shown, over real time: the first {rates[0]:.3f}, the slowest {min(rates):.3f}")
    print(f"100 MB: {crowd.huge}; another's page: {crowd.stranger}; stalled: {crowd.stalled}")
    print(f"memory: {crowd.before:.0f} MiB, later {crowd.after:.0f}")
    held = (
        ended == 0 and rates[0] >= REAL_TIME and crowd.after - crowd.before <= GROWTH
        and crowd.huge.startswith("closed") and crowd.stranger == "403"
    )  # fmt: skip
    return 0 if held else 1


class Crowd:
    """Clients of the viewer at `port`, whose process is `pid`."""

    def __init__(self, port: int, pid: int):
        self.address, self.pid = f"ws://127.0.0.1:{port}", pid
        self.shown: list[list[tuple[float, float]]] = []  # of each: when, and what time was shown
        self.huge = self.stranger = self.stalled = "not tried"
        self.before = self.after = 0.0  # [MiB]

    async def look(self, clients: int, seconds: float) -> None:
        """Open `clients` windows and misbehave in some, until shortly before the viewer's end."""
        await self._answers()
        end = time.monotonic() + seconds - ENDING
        self.shown = [[] for _ in range(clients - 2)]
        async with asyncio.TaskGroup() as group:
            for client in self.shown:
                group.create_task(self._read(client, end))
            group.create_task(self._stall(end))
            group.create_task(asyncio.to_thread(self._send_too_much))
            group.create_task(self._come_from_elsewhere())
            await asyncio.sleep(0.3 * seconds)
            self.before = memory(self.pid)
            await asyncio.sleep(end - time.monotonic() - 1.0)
            self.after = memory(self.pid)

    def rates(self) -> list[float]:
        """Of each client that reads, the time that passed in what it was shown, over real time."""
        spans = [(seen[-1], seen[len(seen) // 4]) for seen in self.shown]
        return [(last[1] - first[1]) / (last[0] - first[0]) for last, first in spans]

    def _open(self, origin: str | None = None, **settings: int) -> websockets.connect:
        return websockets.connect(
            self.address, subprotocols=[PROTOCOL], compression=None, max_size=None,
            additional_headers={} if origin is None else {"Origin": origin}, **settings,
        )  # fmt: skip

    async def _answers(self) -> None:
        """Return as soon as the viewer takes connections."""
        end = time.monotonic() + START
        while True:
            try:
                async with self._open():
                    return
            except OSError:
                if time.monotonic() > end:
                    raise
                await asyncio.sleep(0.2)

    async def _read(self, seen: list[tuple[float, float]], end: float) -> None:
        async with self._open() as client:
            while time.monotonic() < end:
                times = SHOWN.findall(told(await client.recv(decode=False)))
                if times:
                    seen.append((time.monotonic(), float(times[-1])))

    async def _stall(self, end: float) -> None:
        async with self._open(max_queue=1):
            await asyncio.sleep(end - time.monotonic())
            self.stalled = "no message read to the end"

    def _send_too_much(self) -> None:
        try:
            with connect(self.address, subprotocols=[PROTOCOL], compression=None) as client:
                client.send(bytes(HUGE))
                while True:  # of what is shown
                    client.recv(timeout=START)
        except websockets.ConnectionClosed as closed:
            self.huge = f"closed ({closed.rcvd and closed.rcvd.code})"
        except OSError as error:
            self.huge = f"closed ({type(error).__name__})"

    async def _come_from_elsewhere(self) -> None:
        try:
            async with self._open("http://elsewhere.example"):
                self.stranger = "let in"
        except websockets.InvalidStatus as refused:
            self.stranger = str(refused.response.status_code)


def told(message: bytes) -> bytes:
    """The fields of viser's message: two lengths, the packed fields, then what is not packed."""
    size, packed = struct.unpack("<QQ", message[:16])
    return zstandard.decompress(message[16 : 16 + packed], size)


def memory(pid: int) -> float:
    """What the process holds in memory [MiB]."""
    fields = Path(f"/proc/{pid}/status").read_text().split("VmRSS:")[1].split()
    return int(fields[0]) / 1024


if __name__ == "__main__":
    sys.exit(main())
