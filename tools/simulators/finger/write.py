"""Writes a finger day as measurement sets: what a reader gets in plain files, with instrument noise. Truth is for tests only."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tools.simulators.finger.bench import Log
from tools.simulators.finger.motions import Trial

DRIVE, GRAIN, SENSOR, MARKER, CLOUD = 0.01, 0.005, 0.3, 0.2, 0.4  # mm, mm, ohm, mm, mm
FINGER_GRAVITY = (0.0, 0.0, 9.81)  # m/s^2


@dataclass(frozen=True)
class Sheet:
    """What the instruments say of one trial."""

    trial: Trial
    drive: np.ndarray  # (n, 4) mm
    resistance: np.ndarray  # (n, 4) ohm
    markers: np.ndarray | None  # (n, 10, 3) mm, NaN where not seen
    clouds: list[np.ndarray]  # (k, 3) mm a frame; empty where no camera looks
    frames: np.ndarray  # (f,) s


def drive_reading(rng: np.random.Generator, command: np.ndarray) -> np.ndarray:
    """Encoder values: noisy and grained; a drive at its stop reads zero."""
    noisy = command + DRIVE * rng.normal(size=command.shape) * (command != 0)
    return GRAIN * np.round(noisy / GRAIN)


def write_set(folder: Path, title: str, sheets: Sequence[Sheet]) -> None:
    """measurements.toml, one CSV a trial and its clouds; written beside and moved in place when whole."""
    whole = folder.with_name(folder.name + ".partial")
    whole.mkdir(parents=True, exist_ok=True)
    lines = [
        'format  = "twin-measurements/1"',
        'robot   = "finger"',
        f"title   = {json.dumps(title)}",
        'source  = "simulation: independent finite element bench"',
        f"gravity = {list(FINGER_GRAVITY)}",
    ]
    channels = [(f"tendon_{i}_displacement", "input", "mm", DRIVE) for i in range(1, 5)]
    channels += [(f"sensor_{i}_resistance", "output", "ohm", SENSOR) for i in range(1, 5)]
    if sheets[0].markers is not None:
        channels += [(f"marker_{k}_{a}", "output", "mm", MARKER) for k in range(1, sheets[0].markers.shape[1] + 1) for a in "xyz"]
    for name, role, unit, noise in channels:
        lines += ["", "[[channel]]", f'name  = "{name}"', f'role  = "{role}"', f'unit  = "{unit}"', f"noise = {noise}"]
    for sheet in sheets:
        name = sheet.trial.name
        lines += ["", "[[trial]]", f'file  = "{name}.csv"', f"start = {sheet.trial.start}"]
        if len(sheet.frames):
            lines.append(f'cloud = "{name}.clouds.npz"')
            offsets = np.cumsum([0, *map(len, sheet.clouds)])
            points = (1e-3 * np.concatenate(sheet.clouds)).astype(np.float32)
            np.savez_compressed(whole / f"{name}.clouds.npz", points=points, offsets=offsets, time=sheet.frames)
        if sheet.trial.hand:
            lines.append(f'external_contact = "{"two edges" if sheet.trial.edges else "hand"}, force unknown"')
        _write_csv(whole / f"{name}.csv", ["time", *(c[0] for c in channels)], sheet)
    (whole / "measurements.toml").write_text("\n".join(lines) + "\n")
    whole.rename(folder)


def _write_csv(path: Path, header: list[str], sheet: Sheet) -> None:
    blocks = [sheet.trial.time[:, None], sheet.drive, sheet.resistance]
    formats = ["%.2f"] + ["%.3f"] * 4 + ["%.2f"] * 4
    if sheet.markers is not None:
        blocks.append(sheet.markers.reshape(len(sheet.drive), -1))
        formats += ["%.2f"] * blocks[-1].shape[1]
    rows = [",".join(header)]
    for row in np.hstack(blocks):
        rows.append(",".join("" if np.isnan(v) else f % (v + 0.0) for f, v in zip(formats, row, strict=True)))
    path.write_text("\n".join(rows) + "\n")


def peaks(log: Log, axis: np.ndarray) -> dict:
    """The largest tension, tip travel, bend and strains of a trial; `axis` (n, 2, 3): points of the axis at z = 95 and 100 mm."""
    along = axis[:, 1] - axis[:, 0]
    bend = np.rad2deg(np.arccos(np.clip(along[:, 2] / np.linalg.norm(along, axis=1), -1, 1)))
    return {
        "T_max": float(log.tension.max()),
        "tip_max_mm": float(np.linalg.norm(axis[:, 1] - [0, 0, 100], axis=1).max()),
        "bend_max_deg": float(bend.max()),
        "strain": [float(log.strain.min()), float(log.strain.max())],
    }
