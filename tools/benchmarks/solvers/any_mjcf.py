"""Every MJCF under some folders, each made a robot's folder and moved for half a second: taken, or refused with which sentence.

    python -m tools.benchmarks.solvers.any_mjcf FOLDER [FOLDER ...]

A model is taken if `twin new` writes its folder, a twin of it is rolled out, and that twin, a parameter of each kind moved, is
written as an MJCF (or one sentence says why it is not). It is refused if a `TwinError` says why in one line. Anything else is a
fault of ours: the command lists it and ends with 1.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tools.benchmarks import table
from twin.body import Drive
from twin.foundation.errors import TwinError
from twin.measurements import Recording
from twin.prediction.mjcf import Origins, export_mjcf
from twin.prediction.rollout import commands, rollout
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.starter import write_model_starter

SECONDS, RATE = 0.5, 50.0  # of the trial
PERIOD = 0.5  # s, of the sine between the ends of the controls' ranges
SHARE = 0.2  # of the way to those ends
_ROOT = re.compile(rb"<mujoco[\s>]")
_NAMED = re.compile(r"'[^']*'|\"[^\"]*\"|\b\d+\b")


@dataclass(frozen=True)
class Outcome:
    """What became of a model: `said` is the sentence of a refusal, or the fault of ours."""

    path: Path
    what: str  # "taken", "taken, not written", "refused", "fault"
    said: str = ""

    @property
    def kind(self) -> str:
        """The sentence without the names in it."""
        return _NAMED.sub("...", self.said.partition(": ")[2] or self.said)


def models(folders: Iterable[Path]) -> Iterator[Path]:
    """Yield the MJCFs under some folders, each content once."""
    seen = set()
    for path in (p for folder in folders for p in sorted(folder.rglob("*.xml"))):
        content = path.read_bytes()
        if _ROOT.search(content) and content not in seen:
            seen.add(content)
            yield path


def attempt(path: Path) -> Outcome:
    """Make a robot of an MJCF and move it."""
    with tempfile.TemporaryDirectory() as place:
        try:
            folder, _ = write_model_starter("tried", path, Path(place))
            twin = Twin.of(load(str(folder)))
            move(twin)
        except TwinError as refusal:
            return _said(path, "refused", refusal)
        except Exception as fault:  # whatever comes is what is looked for
            return Outcome(path, "fault", f"{type(fault).__name__}: {fault}")
        try:
            export_mjcf(replace(twin, values=moved(twin)), Origins({}, {}))
        except TwinError as refusal:
            return _said(path, "taken, not written", refusal)
        except Exception as fault:  # whatever comes is what is looked for
            return Outcome(path, "fault", f"{type(fault).__name__}: {fault}")
    return Outcome(path, "taken")


def moved(twin: Twin) -> dict[str, float]:
    """Return a standard deviation more of the first parameter of each kind."""
    first = {p.name.partition(".")[0] + p.name.rpartition(".")[2]: p for p in reversed(twin.robot.nuisance)}
    return {p.name: p.value + float(p.std or 0.0) for p in first.values()}


def _said(path: Path, what: str, refusal: TwinError) -> Outcome:
    said = str(refusal)
    return Outcome(path, what if said and "\n" not in said else "fault", said)


def move(twin: Twin) -> Recording:
    """Roll a twin out under a sine of each control, a part of the way from rest to its ends. Raises TwinError if it is lost."""
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    swing, columns = np.sin(2.0 * np.pi * time / PERIOD), {}
    for (port, *_), drive in ((ports, Drive.CONTROL) for ports in twin.robot.build().ports):
        assert port.drive is drive
        low, rest, high = np.where(np.isfinite(port.span), port.span, port.span[1])
        columns[port.channel] = rest + SHARE * np.where(swing > 0.0, (high - rest) * swing, (rest - low) * swing)
    made = rollout(twin, commands(twin, columns, RATE))
    if made.lost:
        raise TwinError(made.lost[0].why)
    return made.recording


def summary(outcomes: list[Outcome]) -> str:
    """Return how many were taken, and how many were refused with which sentences."""
    lines = [table.head("models", "what became of them")]
    lines.append(table.line(sum(o.what == "taken" for o in outcomes), "taken: made a robot, moved, and written as an MJCF"))
    for what in ("taken, not written", "refused", "fault"):
        lines += [table.line(n, f"{what}: {kind}") for kind, n in Counter(o.kind for o in outcomes if o.what == what).most_common()]
    return "\n".join(lines)


def main(folders: list[str]) -> int:
    """Print what becomes of each model, and the table; return 1 where one met a fault of ours."""
    outcomes = []
    for path in models(map(Path, folders)):
        outcomes.append(attempt(path))
        print(f"{outcomes[-1].what:8} {path}: {outcomes[-1].said}", file=sys.stderr, flush=True)
    print(summary(outcomes))
    return int(any(o.what == "fault" for o in outcomes))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
