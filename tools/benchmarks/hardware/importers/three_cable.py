"""The three-cable robot of ARM-Lab: rows a1, a2, a3 (0..100: 0..10 mm of cable), x, y, z (mm, camera frame), in order of the
experiment.

A sweep, one cable drawn in step by step with the others held, becomes a trial; the fast cable's jump back to 0 separates them.
There are no time stamps: a row counts as a second. The first rows of a sweep are all kept, for the dead band is there, then one in
`THIN`.

Far to one side, and near the other edge, the camera has two answers for one pose, (1.5, -2.1, 0.6) mm apart, and flickers between
them. Nothing in a row says which answer it is, so that a sweep ends before its first such jump.
"""

from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from tools.benchmarks.hardware.importers.importer import Dropped
from twin.measurements import Channel, Recording, Trial

PER_STEP = 1e-4  # m of cable per unit of action
# m an axis: a sweep less the mean of those 0.3 mm of cable before and after it, over sqrt(3/2); 0.5 and 0.7 mm away as much. Next
# to each other, 0.1 mm, sweeps stick alike (0.16 mm); the camera alone has 0.05 mm (second differences along a sweep).
CAMERA_NOISE = 2e-4
FIRST_ROWS_KEPT, THIN = 6, 8  # rows kept at a sweep's start; of the rest one in so many
EVERY = 5  # one sweep in so many is taken: odd, since in the second block two cables take turns
# m: a step from row to row that is off the median of the nine around it by more is a flicker. Of all steps 98.8 % are off by less
# than 1 mm, 0.9 % by 2 to 4 mm, 0.3 % by something between.
FLICKER = 1.5e-3
FIRST_BLOCK_ROWS = 10200  # rows of the first block
SHORTEST = 20  # rows of a sweep worth a trial: the last one of the file is cut off


def read(folder: Path) -> tuple[Recording, Dropped]:
    """Every `EVERY`th sweep as a trial, named block_a1_a2_a3 by the held cables, and what was left out."""
    rows = np.loadtxt(folder / "Dataset.txt.gz", delimiter=",")
    starts = np.flatnonzero(np.any(np.diff(rows[:, :3], axis=0) < 0, axis=1)) + 1
    sweeps = np.split(np.arange(len(rows)), starts)
    dropped, trials, thinned, flickering = Dropped(), [], 0, 0
    whole = [s for s in sweeps if len(s) >= SHORTEST]
    dropped.count(
        "Dataset.txt", f"sweeps shorter than {SHORTEST} rows", sum(len(s) for s in sweeps if len(s) < SHORTEST), len(rows)
    )
    taken = whole[::EVERY]
    for all_of_it in taken:
        sweep = all_of_it[: _steady(1e-3 * rows[all_of_it, 3:])]
        flickering += len(all_of_it) - len(sweep)
        kept = np.r_[sweep[:FIRST_ROWS_KEPT], sweep[FIRST_ROWS_KEPT::THIN]]
        thinned += len(sweep) - len(kept)
        action, tip = rows[kept, :3], 1e-3 * rows[kept, 3:]
        fast = int(np.argmax(np.ptp(action, axis=0)))
        held = "_".join("x" if i == fast else f"{int(a)}" for i, a in enumerate(action[0]))
        values = {f"tendon_{i + 1}_displacement": PER_STEP * action[:, i] for i in range(3)}
        values |= {f"marker_1_{axis}": tip[:, j] for j, axis in enumerate("xyz")}
        block = 1 if sweep[0] < FIRST_BLOCK_ROWS else 2
        trials.append(Trial(f"block{block}_{held}.csv", (kept - kept[0]).astype(float), values, start=float(sweep[0])))
    dropped.count("Dataset.txt", f"all but one sweep in {EVERY}", sum(map(len, whole)) - sum(map(len, taken)), 0)
    dropped.count("Dataset.txt", f"from the camera's first jump of {1e3 * FLICKER:g} mm to the end of the sweep", flickering, 0)
    dropped.count("Dataset.txt", f"beyond row {FIRST_ROWS_KEPT} of a sweep all but one in {THIN}", thinned, 0)
    channels = [Channel(f"tendon_{i}_displacement", "input", "mm", 5e-6) for i in (1, 2, 3)]
    channels += [Channel(f"marker_1_{axis}", "output", "mm", CAMERA_NOISE) for axis in "xyz"]
    return Recording(
        "three_cable", "ARM-Lab three-cable robot", "hardware: ARM-Lab, Learning-Based-Position-Control, MIT licence", None,
        tuple(channels), tuple(trials),
    ), dropped  # fmt: skip


def _steady(tip: np.ndarray) -> int:
    """How many rows of a sweep (n, 3) m come before the first flicker; in its first two steps the last release dies away."""
    steps = np.diff(tip, axis=0)
    off = np.linalg.norm(steps - median_filter(steps, size=(9, 1)), axis=1)
    jumps = np.flatnonzero(off[2:] > FLICKER) + 2
    return int(jumps[0]) + 1 if jumps.size else len(tip)
