"""The soft tentacle of SoRoMoX section Va: 22 holds under commanded motor loads, four markers, motion capture.

A raw file is one hold at 200 or 240 Hz; it becomes one trial of `ROWS_PER_HOLD` rows, means over equal parts of it. What is
declared as noise is how well a hold repeats, not how quiet the cameras are (0.01-0.2 mm): the holds were taken in two sessions, and
where both pulled alike they differ by millimetres. That difference, 240 Hz holds against a cubic through the 200 Hz ones, is
measured here and printed. It is the same in all rows of a hold, so each is declared sqrt(ROWS_PER_HOLD) times as noisy: a hold
counts once.

Markers were put on anew between the sessions (where both pulled alike marker 2 sits 8 mm elsewhere, whatever the pull): those of
the second are markers 5 to 8.

Base frame: diag(1, -1, -1) of the authors' robot frame, which is R (p - (base marker + o)).
"""

import csv
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from tools.benchmarks.hardware.importers.importer import Dropped
from twin.measurements import Channel, Recording, Trial

PULLEY = 0.0325  # m: the radius by which the authors turn a motor's torque into tension
R = np.diag([1.0, -1.0, -1.0]) @ np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
BASE_MARKER = np.array([-0.03, -0.013, 0.0])  # m, o: from the base marker to the base
MARKERS = 4
ROWS_PER_HOLD = 3  # the least a trial may have
OUTLIER_DISTANCE = 3e-4  # m from the running median: a swap or reflection of the cameras; holds move by 0.7 mm at most, and slowly
MEDIAN_SAMPLES = 41  # samples of that median, 0.2 s
TENSION_NOISE = 0.05  # N: a commanded load, no load cell; ours, 1-3 % of it


def read(folder: Path) -> tuple[Recording, Dropped]:
    """The raw folder as a recording, one trial a hold, and what was dropped."""
    with (folder / "static_points_derived.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    dropped, holds, times = Dropped(), [], []
    for row in table:
        raw = np.loadtxt(folder / "raw" / row["file"], delimiter=",")
        columns = [int(row[f"{m}_start_col0"]) for m in ("pb", "p1", "p2", "p3", "p4")]
        points = np.stack([raw[:, c : c + 3] for c in columns], axis=1)  # (n, 5, 3)
        off = np.abs(points - median_filter(points, (MEDIAN_SAMPLES, 1, 1), mode="nearest")).max(axis=(1, 2))
        dropped.count(
            row["file"],
            f"more than {1e3 * OUTLIER_DISTANCE:.1f} mm off the running median",
            int((off > OUTLIER_DISTANCE).sum()),
            len(off),
        )
        parts = np.array_split(np.flatnonzero(off <= OUTLIER_DISTANCE), ROWS_PER_HOLD)
        mean = np.stack([points[rows].mean(axis=0) for rows in parts])  # (ROWS_PER_HOLD, 5, 3)
        holds.append((mean[:, 1:] - mean[:, :1] - BASE_MARKER) @ R.T)
        times.append(np.array([raw[rows, 1].mean() for rows in parts]))
    tension = np.array([[float(row[f"torque{i}_Nm"]) / PULLEY for i in (1, 2)] for row in table])
    names = [row["file"].removesuffix(".csv") for row in table]
    second = np.array([float(row["dt_s"]) < 0.0045 for row in table])
    repeats = repeatability(tension, np.mean(holds, axis=1), second)
    channels = [Channel(f"tendon_{i}_tension", "input", "N", TENSION_NOISE) for i in (1, 2)]
    channels += [
        Channel(f"marker_{m + 1}_{a}", "output", "mm", float(np.sqrt(ROWS_PER_HOLD) * repeats[m % MARKERS]))
        for m in range(2 * MARKERS)
        for a in "xyz"
    ]
    trials = []
    for k, name in enumerate(names):
        values = {f"tendon_{i + 1}_tension": np.full(ROWS_PER_HOLD, tension[k, i]) for i in range(2)}
        unseen = np.full_like(holds[k], np.nan)
        both = np.concatenate([unseen, holds[k]] if second[k] else [holds[k], unseen], axis=1)
        values |= {f"marker_{m + 1}_{a}": both[:, m, j] for m in range(2 * MARKERS) for j, a in enumerate("xyz")}
        trials.append(Trial(name + ".csv", times[k], values, start=60.0 * k))
    said = "noise is how holds repeat between sessions: " + ", ".join(f"{1e3 * r:.1f}" for r in repeats) + " mm a coordinate"
    return Recording(
        "tentacle", "SoRoMoX soft tentacle, 22 holds", "hardware: tud-phi/soromox, section Va, MIT licence", None,
        tuple(channels), tuple(trials), notices=(said,),
    ), dropped  # fmt: skip


def repeatability(tension: np.ndarray, means: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n_marker,) m a coordinate, RMS: holds of the second session against a cubic through the first one's, over sqrt(2).

    An upper bound: it contains the interpolation's own error.
    """
    differences = []
    for i in (0, 1):
        alone = (tension[:, i] > 0) & (tension[:, 1 - i] == 0)
        first = np.flatnonzero(alone & ~second)
        first = first[np.argsort(tension[first, i])]
        through = CubicSpline(tension[first, i], means[first])
        inside = alone & second & (tension[:, i] > tension[first[0], i])
        differences += [means[k] - through(tension[k, i]) for k in np.flatnonzero(inside)]
    return np.sqrt(np.square(differences).mean(axis=(0, 2)) / 2.0)


def joined(of_sessions: np.ndarray) -> np.ndarray:
    """(..., 24) of both sessions' markers, one of them NaN in each hold, as (..., 12)."""
    first, second = np.split(of_sessions, 2, axis=-1)
    return np.where(np.isnan(first), second, first)
