"""Three days of the finite element finger worn as one hand: channels renamed, markers turned and moved to where the palm has them.

    python -m tools.hand_day day_1 day_2 day_3 --out hand/          # each a folder of `python -m tools.bench.finger`

The bench commands every finger through the same motions and rows, with markers as noisy along x as along y, and fingers of a hand
do not touch in them. Clouds stay behind, since a hand's are not compared.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from twin.measurements import Channel, Recording, Trial, read, write
from twin.robots import load
from twin.soft import HandBody


def worn(fingers: Sequence[Recording]) -> Recording:
    """The hand's recording of one finger's each, finger 1 first."""
    body = load("hand").build()
    assert isinstance(body, HandBody)
    names = [_prefixed(k, c) for k, finger in enumerate(fingers) for c in finger.channels]
    trials = []
    for n, first in enumerate(fingers[0].trials):
        values: dict[str, np.ndarray] = {}
        for k, finger in enumerate(fingers):
            assert np.array_equal(finger.trials[n].time, first.time), "days of other motions"
            values |= _placed(k, finger.trials[n], body.places[k], body.turns[k])
        trials.append(replace(first, values=values, clouds=None))
    title = "Hand of " + ", ".join(finger.title for finger in fingers)
    return replace(fingers[0], robot="hand", title=title, channels=tuple(names), trials=tuple(trials), folder=None)


def _prefixed(k: int, channel: Channel) -> Channel:
    return Channel(f"finger_{k + 1}_{channel.name}", channel.role, channel.unit, channel.noise)


def _placed(k: int, trial: Trial, place: np.ndarray, turn: np.ndarray) -> dict[str, np.ndarray]:
    moved = dict(trial.values)
    for point in {name.removesuffix("_x") for name in trial.values if name.endswith("_x")}:
        seen = np.stack([trial.values[f"{point}_{a}"] for a in "xyz"], axis=1) @ turn.T + place
        moved |= {f"{point}_{a}": column for a, column in zip("xyz", seen.T, strict=True)}
    return {f"finger_{k + 1}_{name}": column for name, column in moved.items()}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.hand_day", description=__doc__)
    parser.add_argument("days", type=Path, nargs=3)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    write(worn([read(day / "measured") for day in asked.days]), asked.out / "measured")
    print(f"written: {asked.out / 'measured'}")


if __name__ == "__main__":
    main()
