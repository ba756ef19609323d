"""Raw logs of 100 Hz, with and without a budget: python -m tools.benchmarks.diagnosis.raw_log OUT

Two trials of slow sines by an independent rod (tools.simulators.rod), without an effect and with tendon friction; tensions within
0.01 N, markers of three disks within 0.25 mm. Prints what is said, the time it took and the errors on held-out trials.
"""

import time
from pathlib import Path

import numpy as np
import tyro

from tools.benchmarks.table import markdown
from tools.simulators.rod.mechanics.rod import follow
from tools.simulators.rod.nuisance import built
from twin.diagnosis import Settings, diagnose
from twin.measurements import Channel, Recording, Trial, write

RATE, DISKS = 100.0, (3, 5, 8)  # Hz of the log; disks with a marker
GRAVITY = (0.0, 0.0, 9.81)
NOISE_OF_TENSION, NOISE_OF_MARKER = 0.01, 2.5e-4  # N, m
PULLS = tuple(Channel(f"tendon_{i}_tension", "input", "N", NOISE_OF_TENSION) for i in (1, 2, 3))
MARKERS = tuple(Channel(f"disk_{k}_{a}", "output", "mm", NOISE_OF_MARKER) for k in DISKS for a in "xyz")


def raw_log(mu: float, rows: int, seed: int = 0) -> Recording:
    """Return two trials of `rows` rows of a built rod whose tendons rub by `mu`."""
    rng = np.random.default_rng(seed)
    rod, clock, trials = built(rng), np.arange(rows) / RATE, []
    for k in range(2):
        phases = (0.2 + 0.06 * k) * clock[:, None] + 2.1 * np.arange(3) + k
        tension = np.maximum(0.0, 1.5 * np.sin(phases)) * np.minimum(1.0, clock / 2.0)[:, None]
        seen = follow(rod, tension, mu=mu, gravity=GRAVITY).markers[:, [d - 1 for d in DISKS]].reshape(rows, -1)
        columns = [*(tension + rng.normal(0.0, NOISE_OF_TENSION, tension.shape)).T]
        columns += [*(seen + rng.normal(0.0, NOISE_OF_MARKER, seen.shape)).T]
        values = {c.name: column for c, column in zip((*PULLS, *MARKERS), columns, strict=True)}
        trials.append(Trial(f"{k + 1}.csv", clock, values, start=k * (rows / RATE + 60.0)))
    return Recording("continuum", f"mu {mu:g}", "simulation", np.array(GRAVITY), (*PULLS, *MARKERS), tuple(trials))


def main(out: tyro.conf.Positional[Path], rows: int = 7500, budgets: tuple[float, ...] = (60.0, 0.0)) -> None:
    """Diagnose two logs under each budget.

    Args:
        out: folder for the logs
        rows: of each trial
        budgets: in seconds; 0 is none
    """
    lines = []
    for mu in (0.0, 0.15):
        log = raw_log(mu, rows)
        write(log, out / f"mu_{mu:g}")
        for budget in budgets:
            begun = time.monotonic()
            found = diagnose(log, settings=Settings(budget=budget or None))
            took = time.monotonic() - begun
            before, after = (1e3 * e["marker"] for e in (found.errors.calibrated, found.errors.after))
            said = ", ".join(c.effect for c in found.claims) or "nothing"
            lines.append((f"{mu:g}", f"{budget or 'none'}", found.verdict, said, f"{took:.0f}", f"{before:.2f}", f"{after:.2f}"))
    print(markdown(("true mu", "budget, s", "verdict", "claimed", "took, s", "calibrated, mm", "after, mm"), lines))


if __name__ == "__main__":
    tyro.cli(main)
