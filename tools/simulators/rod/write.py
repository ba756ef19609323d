"""Writes a bench day as a measurement set (measurements.toml and one CSV per trial) and, beside it, truth.json.

Truth is for tests only: nothing in measurements.toml points to it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from tools.simulators.rod.bench import Log
from tools.simulators.rod.design import Day
from tools.simulators.rod.effects import Effect
from tools.simulators.rod.mechanics.rod import Rod
from tools.simulators.rod.sensors import Noise


@dataclass(frozen=True)
class Logged:
    """What a set logs beside tensions and markers. `exact_input`: a tension that drives the robot is a command without noise."""

    displacement: bool = False
    ambient: bool = False
    exact_input: bool = False

    @classmethod
    def of(cls, day: Day, **asked: bool) -> Logged:
        """What was asked for, and what the day's drive needs."""
        given = cls(**asked)
        exact = given.exact_input and not (day.driven_by_length or day.driven_by_current)
        return cls(given.displacement or day.driven_by_length, given.ambient or day.driven_by_current, exact)


def write_set(
    folder: Path, title: str, day: Day, logs: Sequence[Log], noise: Noise, rng: np.random.Generator, **logged: bool
) -> None:
    """Add sensor noise and write; `logged` are fields of `Logged`."""
    folder.mkdir(parents=True, exist_ok=True)
    also, disks = Logged.of(day, **logged), logs[0].markers.shape[1]
    shown = [disks - 1] if day.tip_only else list(range(disks))
    channels = _channels(day, noise, also, logs[0].tension.shape[1], shown)
    lines = [
        'format  = "twin-measurements/1"',
        'robot   = "continuum"',
        f"title   = {json.dumps(title)}",
        'source  = "simulation: independent Kirchhoff bench with virtual load cells and camera"',
        f"gravity = {list(day.gravity)}",
    ]
    for name, role, unit, sigma in channels:
        lines += ["", "[[channel]]", f'name = "{name}"', f'role = "{role}"', f'unit = "{unit}"']
        lines += [] if sigma is None else [f"noise = {sigma:.4g}"]
    for log in logs:
        file = f"{log.trial.name}.csv"
        lines += ["", "[[trial]]", f'file = "{file}"', f"start = {log.trial.start}"]
        lines.append(f'tip_payload = "{1e3 * log.trial.payload:g} g"')
        lines += [] if log.trial.gravity is None else [f"gravity = {list(log.trial.gravity)}"]
        _write_csv(folder / file, [name for name, *_ in channels], _columns(log, day, noise, also, shown, rng))
    (folder / "measurements.toml").write_text("\n".join(lines) + "\n")


Channel = tuple[str, str, str, float | None]  # name, role, unit and noise


def _channels(day: Day, noise: Noise, also: Logged, tendons: int, shown: Sequence[int]) -> list[Channel]:
    numbers = range(1, tendons + 1)
    role = "output" if day.driven_by_length or day.driven_by_current else "input"
    found: list[Channel] = [(f"tendon_{i}_tension", role, "N", None if also.exact_input else noise.load_cell) for i in numbers]
    found += [(f"disk_{k + 1}_{axis}", "output", "mm", 1e3 * noise.marker) for k in shown for axis in "xyz"]
    if also.displacement:
        role = "input" if day.driven_by_length else "output"
        found += [(f"tendon_{i}_displacement", role, "mm", 1e3 * noise.displacement) for i in numbers]
    if also.ambient:
        found.append(("ambient_temperature", "context", "degC", noise.ambient))
    if day.driven_by_current:
        found += [(f"sma_{i}_current", "input", "A", noise.current) for i in numbers]
        found += [(f"sma_{i}_temperature", "output", "degC", noise.spring) for i in numbers]
    return found


def _columns(
    log: Log, day: Day, noise: Noise, also: Logged, shown: Sequence[int], rng: np.random.Generator
) -> list[tuple[np.ndarray, str]]:
    """Return noisy values (n, k) and their format, channel by channel, the time first."""
    tension = log.tension if also.exact_input else log.tension + noise.load_cell * rng.normal(size=log.tension.shape)
    markers = noise.of_markers(rng, log.markers)[:, shown].reshape(len(log.tension), -1)
    found = [(log.trial.time[:, None], "%.4f"), (tension, "%.4f"), (1e3 * markers, "%.3f")]
    travel = log.displacement + noise.displacement * rng.normal(size=log.displacement.shape)
    if also.displacement:
        found.append((1e3 * travel, "%.4f"))
    if also.ambient:
        found.append(((log.ambient + noise.ambient * rng.normal(size=len(log.ambient)))[:, None], "%.2f"))
    if day.driven_by_current:
        found.append((log.current + noise.current * rng.normal(size=log.current.shape), "%.4f"))
        found.append((log.temperature + noise.spring * rng.normal(size=log.temperature.shape), "%.2f"))
    return found


def _write_csv(path: Path, names: list[str], columns: list[tuple[np.ndarray, str]]) -> None:
    formats = [form for values, form in columns for _ in range(values.shape[1])]
    rows = [",".join(["time", *names])]
    for row in np.hstack([values for values, _ in columns]):
        rows.append(",".join("" if np.isnan(v) else f % v for f, v in zip(formats, row, strict=True)))
    path.write_text("\n".join(rows) + "\n")


def write_truth(
    folder: Path, made: Mapping[str, int | str], rod: Rod, effects: Sequence[tuple[Effect, float]], noise: Noise
) -> None:
    """Write how the set was made, its effects with their amplitude in sigmas, the built robot and the noise."""
    truth = {
        **made,
        "effects": [
            {"id": e.id, "in_catalogue": e.in_catalogue, "seen_in": e.seen_in, "sigmas": round(a, 3), "parameters": asdict(e)}
            for e, a in effects
        ],
        "rod": asdict(rod),
        "noise": {k: v for k, v in asdict(noise).items() if np.isfinite(v)},
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1, default=lambda a: a.tolist()) + "\n")
