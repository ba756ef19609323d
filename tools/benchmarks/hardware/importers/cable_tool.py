"""The cable-driven da Vinci tool of MRDLab: angle and torque at both ends of a long cable pair, 1 kHz, 20 s a run.

A run is a trial: means over `MEAN` rows (25 Hz: the motion is at 0.5 Hz at most), without the start-up transient. Angles and
the load's torque keep the sign of their own sensor; the input's cell reads the reaction: its sign is turned, so that torque times
speed is the power that goes in. It is context: most of it is friction before the tendons, in the bearings of motor and drum.
"""

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.benchmarks.hardware.importers.importer import Dropped
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial

TOOL = "Tool_4_Maryland_R_5"
MIRRORED_TOOLS = {"Tool_4_Maryland_L_Roll_3": ("200", "203"), "Tool_4_Maryland_L_Pitch_3": ("000", "003")}  # the jaw's mirror image
RATES = (0.1, 0.2, 0.3, 0.4, 0.5)  # Hz, first digit of a file's name
LOAD_PERCENTS = (10, 20, 30, 40)  # per cent, second digit
START_UP = 1.0  # s
MEAN = 40  # rows
IN_TURN, OUT_TURN = 8192.0, 4000.0  # counts a turn, encoders at input and output
TORQUE = 3.9811e-5  # N m a count, both cells
FULL_LOAD = 0.116  # N m, 100 %: six loads of the three tools read here lie within 3 % of it, times their per cent
# rad: how the output's loop repeats from rate to rate, 0.44-0.51 deg at the four loads, tested runs among them; a count is 0.09
REPEATS = np.deg2rad(0.5)


def read(folder: Path) -> tuple[Recording, Dropped]:
    """The twenty runs of one tool at five rates and four loads, named by both, and what was left out."""
    dropped = Dropped()
    runs = {(rate, load): f"{TOOL}/{i}{j}.TXT.gz" for i, rate in enumerate(RATES) for j, load in enumerate(LOAD_PERCENTS)}
    named = {f"load{load}_{rate:.1f}Hz.csv": name for (rate, load), name in runs.items()}
    return _recording(TOOL, [_run(folder, name, label, dropped) for label, name in named.items()]), dropped


def read_other(folder: Path, tool: str) -> Recording:
    """The runs at 20 and 80 % load and 0.3 Hz of one of `MIRRORED_TOOLS`."""
    labels = (f"load{load}_0.3Hz.csv" for load in (20, 80))
    return _recording(
        tool, [_run(folder, f"{tool}/{n}.TXT.gz", w, Dropped()) for n, w in zip(MIRRORED_TOOLS[tool], labels, strict=True)]
    )


def read_all(folder: Path) -> list[Recording]:
    """Every run below a folder (*.TXT or *.TXT.gz), a recording for each tool and pose.

    A folder holds one tool; the last digit of a file's name is its load, and of three digits the others are a pose. Headers were
    edited by hand and may be wrong: load and rate are told by torque and angle themselves. Raises DataError where there is no run.
    """
    found: dict[str, list[Path]] = {}
    for path in sorted(p for p in folder.rglob("*") if p.name.lower().endswith((".txt", ".txt.gz"))):
        stem = path.name.partition(".")[0]
        if stem.isdigit():
            pose = stem[:-1] if len(stem) > 2 else ""
            found.setdefault(f"{path.parent.name} {pose}".strip(), []).append(path)
    if not found:
        raise DataError(f"{folder}: no runs; they are files of digits, as 203.TXT.gz")
    return [_recording(tool, _named([_run(p.parent, p.name, p.name, Dropped()) for p in paths])) for tool, paths in found.items()]


def _named(runs: list[Trial]) -> list[Trial]:
    """Runs by load and rate, as measured, the lightest first; those that are alike are numbered."""
    seen: dict[str, int] = {}
    out = []
    for run in sorted(runs, key=lambda r: abs(r.values["joint_2_torque"].mean())):
        q = run.values["joint_1_angle"]
        power = np.abs(np.fft.rfft((q - q.mean()) * np.hanning(len(q)), 16 * len(q)))
        rate = np.fft.rfftfreq(16 * len(q), float(np.median(np.diff(run.time))))[int(power.argmax())]
        load = 10 * round(abs(run.values["joint_2_torque"].mean()) / FULL_LOAD * 10)
        label = f"load{load}_{rate:.1f}Hz"
        seen[label] = seen.get(label, 0) + 1
        again = f"_{seen[label]}" if seen[label] > 1 else ""
        out.append(replace(run, name=f"{label}{again}.csv"))
    return out


def _run(folder: Path, name: str, label: str, dropped: Dropped) -> Trial:
    opened = gzip.open if name.endswith(".gz") else open
    with opened(folder / name, "rt", encoding="latin-1") as file:
        rows = np.loadtxt(file, delimiter=",", comments="%")
    kept = rows[rows[:, 0] > START_UP]
    dropped.count(name, "start-up transient", len(rows) - len(kept), len(rows))
    whole = len(kept) // MEAN * MEAN
    dropped.count(name, f"left over from means of {MEAN}", len(kept) - whole, 0)
    mean = kept[:whole].reshape(-1, MEAN, rows.shape[1]).mean(axis=1)
    values = {
        "joint_1_angle": 2 * np.pi / IN_TURN * mean[:, 1],
        "joint_1_torque": -TORQUE * mean[:, 2],
        "joint_2_angle": 2 * np.pi / OUT_TURN * mean[:, 4],
        "joint_2_torque": TORQUE * mean[:, 5],
    }
    return Trial(label, mean[:, 0], values)


def _recording(tool: str, trials: list[Trial]) -> Recording:
    channels = (
        Channel("joint_1_angle", "input", "deg", float(np.deg2rad(360 / IN_TURN))), Channel("joint_2_torque", "input", "N*m"),
        Channel("joint_2_angle", "output", "deg", float(REPEATS)), Channel("joint_1_torque", "context", "N*m"),
    )  # fmt: skip
    source = f"hardware: MRDLab/mis-tool-characterization, {tool}, ODbL (O'Neill, Stephens, Kowalewski, RA-L 2018)"
    return Recording("cable_tool", f"MRDLab {tool}", source, None, channels, tuple(trials))
