"""Writes a bench day as a measurement set (measurements.toml and one CSV per trial) and, beside it, truth.json.

Truth is for tests only: nothing in measurements.toml points to it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tools.bench.bench import Log
from tools.bench.design import Day
from tools.bench.effects import Effect
from tools.bench.rod import Rod
from tools.bench.sensors import Noise


def write_set(
    folder: Path,
    title: str,
    day: Day,
    logs: Sequence[Log],
    noise: Noise,
    rng: np.random.Generator,
    *,
    displacement: bool = False,
    ambient: bool = False,
    exact_input: bool = False,
) -> None:
    """Add sensor noise and write. `exact_input`: a tension that drives the robot is a command, which no instrument blurs."""
    folder.mkdir(parents=True, exist_ok=True)
    disks, tendons = logs[0].markers.shape[1], logs[0].tension.shape[1]
    shown = [disks - 1] if day.tip_only else list(range(disks))
    lines = [
        'format  = "twin-measurements/1"',
        'robot   = "continuum"',
        f"title   = {json.dumps(title)}",
        'source  = "simulation: independent Kirchhoff bench with virtual load cells and camera"',
        f"gravity = {list(day.gravity)}",
    ]

    def channel(name: str, role: str, unit: str, sigma: float | None) -> None:
        lines.extend(["", "[[channel]]", f'name = "{name}"', f'role = "{role}"', f'unit = "{unit}"'])
        if sigma is not None:
            lines.append(f"noise = {sigma:.4g}")

    commanded = exact_input and not (day.by_length or day.by_current)
    for i in range(tendons):
        role = "output" if day.by_length or day.by_current else "input"
        channel(f"tendon_{i + 1}_tension", role, "N", None if commanded else noise.load_cell)
    for k in shown:
        for axis in "xyz":
            channel(f"disk_{k + 1}_{axis}", "output", "mm", 1e3 * noise.marker)
    displacement = displacement or day.by_length
    if displacement:
        for i in range(tendons):
            role = "input" if day.by_length else "output"
            channel(f"tendon_{i + 1}_displacement", role, "mm", 1e3 * noise.displacement)
    if ambient or day.by_current:
        channel("ambient_temperature", "context", "degC", noise.ambient)
    if day.by_current:
        for i in range(tendons):
            channel(f"sma_{i + 1}_current", "input", "A", noise.current)
        for i in range(tendons):
            channel(f"sma_{i + 1}_temperature", "output", "degC", noise.spring)

    for log in logs:
        file = f"{log.trial.name}.csv"
        lines.extend(["", "[[trial]]", f'file = "{file}"', f"start = {log.trial.start}"])
        lines.append(f'tip_payload = "{1e3 * log.trial.payload:g} g"')
        if log.trial.gravity is not None:
            lines.append(f"gravity = {list(log.trial.gravity)}")
        tension = log.tension if commanded else log.tension + noise.load_cell * rng.normal(size=log.tension.shape)
        markers = noise.of_markers(rng, log.markers)[:, shown].reshape(len(log.tension), -1)
        columns = [log.trial.time[:, None], tension, 1e3 * markers]
        formats = ["%.4f"] + ["%.4f"] * tendons + ["%.3f"] * markers.shape[1]
        travel = log.displacement + noise.displacement * rng.normal(size=log.displacement.shape)
        if displacement:
            columns.append(1e3 * travel)
            formats += ["%.4f"] * tendons
        if ambient or day.by_current:
            columns.append((log.ambient + noise.ambient * rng.normal(size=len(log.ambient)))[:, None])
            formats.append("%.2f")
        if day.by_current:
            columns.append(log.current + noise.current * rng.normal(size=log.current.shape))
            columns.append(log.temperature + noise.spring * rng.normal(size=log.temperature.shape))
            formats += ["%.4f"] * tendons + ["%.2f"] * tendons
        _write_csv(folder / file, np.hstack(columns), formats, [n[8:-1] for n in lines if n.startswith("name = ")])
    (folder / "measurements.toml").write_text("\n".join(lines) + "\n")


def _write_csv(path: Path, table: np.ndarray, formats: list[str], names: list[str]) -> None:
    rows = [",".join(["time", *names])]
    for row in table:
        rows.append(",".join("" if np.isnan(v) else f % v for f, v in zip(formats, row, strict=True)))
    path.write_text("\n".join(rows) + "\n")


def write_truth(
    folder: Path, seed: int, design: str, rod: Rod, effects: Sequence[tuple[Effect, float]], noise: Noise, mismatch: str = "built"
) -> None:
    """What the set's reader is to find out: effects with their amplitude in sigmas, the built robot, the noise."""
    truth = {
        "seed": seed,
        "design": design,
        "mismatch": mismatch,
        "effects": [
            {"id": e.id, "in_catalogue": e.in_catalogue, "seen_in": e.seen_in, "sigmas": round(a, 3), "parameters": asdict(e)}
            for e, a in effects
        ],
        "rod": asdict(rod),
        "noise": {k: v for k, v in asdict(noise).items() if np.isfinite(v)},
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1, default=lambda a: a.tolist()) + "\n")
