"""A run's files: a line a minute in minutes.jsonl, the state to go on from in state.npz, its provenance in run.json.

The line is written before the state, and lines beyond the state's time are dropped when a run goes on: whatever stops it, the
minutes that are there are those of one run.
"""

from __future__ import annotations

import json
import os
import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tools.benchmarks.control.endurance.rig import Look, Rig
from tools.benchmarks.table import markdown, read_rows
from twin.foundation.errors import DataError
from twin.prediction.provenance import run_provenance
from twin.tasks.imitation.demonstrate import write_json

MINUTES, STATE, RUN = "minutes.jsonl", "state.npz", "run.json"
MM = 1e3
NOTHING = Look(*(float("nan"),) * len(Look._fields))  # of a minute that was lost in its first step
Line = dict[str, Any]


def resident() -> float:
    """Return the MB of this process in memory (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


def line(looks: Sequence[Look], rig: Rig, wall: float) -> Line:
    """Return the line of a minute: simulated hours until now; distances, mm, in free air (`free`) and over all;
    mean and largest; the largest and
    least tensions (N), shortening (mm) and share of the rate allowed; faults since the first step; memory, MB; hours of the clock
    since the first step, and which process it was."""
    error, pushed, twin, plant, shortening, rate, least = np.array(looks or [NOTHING], float).T
    free = error[pushed == 0.0]
    return {
        "hours": rig.time / 3600.0, "error": MM * error.mean(), "error_most": MM * error.max(),
        "free": MM * free.mean() if len(free) else None, "tension": twin.max(), "plant_tension": plant.max(), "least": least.min(),
        "shortening": MM * shortening.max(), "rate": rate.max(), "faults": dict(rig.faults), "unshown": rig.course.unshown,
        "rss": resident(), "wall": wall, "process": os.getpid(),
    }  # fmt: skip


def save(folder: Path, rig: Rig) -> None:
    """Write the state, whole or not at all."""
    part = folder / (STATE + ".part")
    with part.open("wb") as file:
        np.savez(file, **rig.state())
    part.replace(folder / STATE)


def begun(folder: Path, seed: int) -> tuple[Rig, list[Line]]:
    """Return the rig of a folder and its minutes; hanging at rest if the folder is new. Raises DataError for another seed's run."""
    if not (folder / STATE).exists():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / MINUTES).write_text("", "utf-8")
        write_json(folder / RUN, run_provenance(" ".join(sys.argv), seed, ""))
        return Rig(seed), []
    with np.load(folder / STATE, allow_pickle=False) as file:
        state = dict(file)
    if int(state["seed"]) != seed:
        raise DataError(f"{folder} holds a run of seed {int(state['seed'])}; ask for that seed to go on, or give another --out")
    rig = Rig.of(state)
    minutes = [m for m in read_rows(folder / MINUTES) if m["hours"] <= rig.time / 3600.0 + 1e-9]
    (folder / MINUTES).write_text("".join(json.dumps(m) + "\n" for m in minutes), "utf-8")
    if minutes:
        rig.faults.update(minutes[-1]["faults"])
        rig.course.unshown = minutes[-1]["unshown"]
    return rig, minutes


def table(minutes: Sequence[Line]) -> str:
    """Return a Markdown table of what was looked for, and what was seen."""
    last, faults = minutes[-1], minutes[-1]["faults"]
    hour = [m for m in minutes if m["hours"] <= 1.0], [m for m in minutes if m["hours"] > last["hours"] - 1.0]

    def each(name: str, of: Sequence[Line] = minutes) -> np.ndarray:
        return np.array([m[name] for m in of if m[name] is not None and np.isfinite(m[name])] or [np.nan])

    def hours(name: str) -> str:
        first, end = (each(name, of).mean() for of in hour)
        return f"{first:.3f}, {end:.3f}"

    rows = {
        "hours simulated (of the clock)": f"{last['hours']:.2f} ({last['wall'] / 3600.0:.2f})",
        "not finite, motion lost": f"{faults.get('nan', 0)}, {faults.get('lost', 0)}",
        "limits broken: rate, most pull": f"{faults.get('rate', 0)}, {faults.get('most', 0)}",
        "largest share of the rate": f"{each('rate').max():.2f}",
        "pull by the twin, N": f"{each('least').min():.3f} to {each('tension').max():.3f}",
        "largest pull of the plant, N": f"{each('plant_tension').max():.3f}",
        "largest shortening, mm": f"{each('shortening').max():.2f}",
        "steps without an answer of the controller": f"{faults.get('no answer', 0)}",
        "wanted shapes that were not found": f"{last['unshown']}",
        "memory, MB an hour simulated": grown(minutes),
        "distance in free air, first and last hour, mm": hours("free"),
        "distance, pushes too, first and last hour, mm": hours("error"),
        "largest distance, mm": f"{each('error_most').max():.2f}",
    }
    return markdown(("", ""), list(rows.items()))


def grown(minutes: Sequence[Line]) -> str:
    """Return, in words, the slope of a line through the memory of the longest process, from a tenth of its minutes on."""
    processes = [m["process"] for m in minutes]
    longest = max(set(processes), key=processes.count)
    own = [(m["hours"], m["rss"]) for m in minutes if m["process"] == longest]
    late = np.array(own[len(own) // 10 :])
    if len(late) < 3:
        return "too few minutes"
    slope = np.polyfit(late[:, 0], late[:, 1], 1)[0]
    return f"{slope:+.2f} over {np.ptp(late[:, 0]):.2f} h of one process, {late[0, 1]:.0f} MB to {late[-1, 1]:.0f}"
