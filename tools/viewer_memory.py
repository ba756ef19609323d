"""Memory of the viewer over an hour's replay loop with clients coming and going.

    python -m tools.viewer_memory [ROBOT] [--pictures 216000] [--clients 4]

An hour at 60 pictures a second, drawn as fast as they come. Clients are other processes that take all they are sent, stay for some
seconds and come again; effects are switched and trials changed meanwhile. Prints the resident memory as it goes, and its growth
from the first tenth on.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import multiprocessing
import os
import time
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import viser
import websockets
from viser._messages import ViewerCameraMessage

from twin.effects import named
from twin.measurements import read
from twin.robots.robot import models_folder
from twin.twin import Twin
from twin.viewer import App

SETS = {"continuum": "friday", "finger": "drift"}
STAYS = 3.0  # s of a client
LOOKS = 40  # readings of the memory
CHANGES = 997  # pictures between two changes of what is shown
PAGE = os.sysconf("SC_PAGE_SIZE") / 1e6  # MB


def resident() -> float:
    """MB of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def client(port: int, over) -> None:  # type: ignore[no-untyped-def]
    """Come, say where it looks from, take what is sent, go, come again."""
    camera = ViewerCameraMessage((1.0, 0.0, 0.0, 0.0), (0.0, 2.0, 0.0), 1.0, 0.1, 10.0, 600, 800, (0.0,) * 3, (0.0, 0.0, 1.0))

    async def visit() -> None:
        protocol = websockets.Subprotocol(f"viser-v{viser.__version__}")
        async with websockets.connect(f"ws://127.0.0.1:{port}", subprotocols=[protocol], max_size=None) as line:
            await line.send(msgspec.msgpack.encode(camera.as_serializable_dict()))
            end = time.monotonic() + STAYS
            while time.monotonic() < end and not over.is_set():
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(line.recv(), 0.2)

    while not over.is_set():
        with contextlib.suppress(OSError, websockets.WebSocketException):
            asyncio.run(visit())


def watch(app: App, pictures: int) -> tuple[np.ndarray, int]:
    """Pictures drawn and MB (n, 2) at equal intervals, and how many clients came."""
    seen, came, there = [], 0, set()
    for k in range(pictures):
        app.tick()
        if k % CHANGES == 0:
            app.scrubber.trial.value = app.scrubber.labels[k // CHANGES % len(app.scrubber.labels)]
            for n, box in enumerate(app.sides[0].effects.values()):
                box.value = bool(k // CHANGES >> n & 1)
            app._wanted = True
        if k % 60 == 0:
            now = set(app.server.get_clients())
            came, there = came + len(now - there), now
        if k % (pictures // LOOKS) == 0:
            seen.append((k, resident()))
            print(f"{k} pictures: {seen[-1][1]:.1f} MB, {len(there)} clients, {came} came", flush=True)
    return np.array(seen, float), came


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("robot", nargs="?", default="continuum", choices=sorted(SETS))
    options.add_argument("--pictures", type=int, default=216_000)
    options.add_argument("--clients", type=int, default=4)
    asked = options.parse_args()
    twin = Twin.of(asked.robot)
    if asked.robot == "continuum":
        twin = replace(twin, effects=(named("tendon_friction")({"mu": 0.21}), named("backbone_creep")({})))
    context = multiprocessing.get_context("spawn")
    over, server = context.Event(), viser.ViserServer(host="127.0.0.1", port=8720, verbose=False)
    app = App(server, [("", twin)], read(models_folder() / asked.robot / "samples" / SETS[asked.robot]))
    app.tick()
    app.scrubber.play.value, app.scrubber.speed.value = True, 20.0
    others = [context.Process(target=client, args=(server.get_port(), over)) for _ in range(asked.clients)]
    for process in others:
        process.start()
    try:
        seen, came = watch(app, asked.pictures)
    finally:
        over.set()
        for process in others:
            process.join()
        server.stop()
    late = seen[len(seen) // 10 :]
    slope = float(np.polyfit(late[:, 0], late[:, 1], 1)[0]) * asked.pictures
    print(
        f"{asked.robot}: {asked.pictures} pictures, {came} clients came; {late[-1, 1] - late[0, 1]:+.1f} MB since a tenth of them"
    )
    print(f"a line from there on: {slope:+.1f} MB an hour's worth; {seen[0, 1]:.0f} MB at first, {seen[:, 1].max():.0f} MB at most")


if __name__ == "__main__":
    main()
