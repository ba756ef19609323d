"""Alignment as the paper does it, for comparison: CMA-ES over R0, kappa of stretch and compression of every sensor and the mounting
angle at once; the misfit is the robust one-way distance of the clouds to the visible skin of the shape that the `modal` estimator
makes of the resistances. It asks nothing of what each number does. `pip install cma`.
"""

from __future__ import annotations

import warnings

import cma
import numpy as np

from twin.measurements import Recording
from twin.measurements.patches import side
from twin.sensors import Cords, strain
from twin.shape.cloud_fit import BEYOND, CLOUD
from twin.shape.estimator import Felt
from twin.shape.modal import Network
from twin.shape.sensing import sense
from twin.soft.skin import Skin, distances, facing
from twin.soft.statics import turned
from twin.threads import single_thread
from twin.twin import Twin

EVERY = 3  # clouds of a trial that count, to save time
TRIALS = 1500


def search(recording: Recording, twin: Twin, seed: int = 1) -> tuple[dict[str, float], int]:
    """Values by parameter, and how many were tried."""
    body = twin.robot.silicone(twin.body())
    free = [p for p in twin.robot.nuisance if p.name.startswith(("sensors.", "mounting."))]
    skin, net = Skin.of(body), Network.of(twin.robot)
    clouds = {t.name: t.clouds for t in recording.trials}
    camera = side([c for c in clouds.values() if c is not None])
    frames = []
    for s in sense(recording, twin)[0]:
        c = clouds[s.name]
        if c is not None:
            at = np.abs(s.time[None] - c.time[:, None]).argmin(axis=1)
            o = c.offsets
            frames += [(s.resistance[i], s.displacement[i], c.points[o[f] : o[f + 1]]) for f, i in enumerate(at)][::EVERY]
    resistance, displacement = (np.stack([f[k] for f in frames]) for k in (0, 1))

    def misfit(x: np.ndarray) -> float:
        values = {p.name: float(np.clip(p.value + (p.std or 1.0) * v, p.low, p.high)) for p, v in zip(free, x, strict=True)}
        cords = Cords(
            *(np.array([values[f"sensors.{n}_{i}"] for i in range(1, 5)]) for n in ("resistance", "stretch", "compression"))
        )
        nodes = net.modes.nodes(net(Felt(strain(resistance, cords), displacement))[0])
        turn, total = turned(values["mounting.angle"]), 0.0
        for u, (_, _, cloud) in zip(nodes, frames, strict=True):
            place, normals = skin.at(u)
            d = distances(cloud @ turn, place, normals, facing(normals, turn, camera))[0] / (BEYOND * CLOUD)
            total += float((np.sqrt(1.0 + d**2) - 1.0).mean())
        return total + 1e-3 * float(x @ x)

    with warnings.catch_warnings(), single_thread():
        warnings.simplefilter("ignore")
        best, run = cma.fmin2(misfit, np.zeros(len(free)), 0.5, {"maxfevals": TRIALS, "seed": seed, "verbose": -9})
    found = {p.name: float(np.clip(p.value + (p.std or 1.0) * v, p.low, p.high)) for p, v in zip(free, best, strict=True)}
    return found, int(run.result.evaluations)
