"""The three-cable robot: alternate sweeps of the first block fitted, the other alternates and the second block tested."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from tools.comparisons.row import Row
from tools.importers import three_cable
from twin.bench import Bench, prepare
from twin.calibrate import Model, fit
from twin.diagnose import Diagnosis, Settings, diagnose
from twin.diagnose.objective import objective_of
from twin.effects import named
from twin.errors import SolveError
from twin.measurements import Recording
from twin.robots import load
from twin.twin import Twin, readings, report, simulate

SETTINGS = Settings(jobs=1)
DEAD_BAND = "tendon_backlash"


def compare(folder: Path) -> tuple[list[Row], Recording, Diagnosis]:
    recording, dropped = three_cable.read(folder)
    print(f"three_cable: {len(recording.trials)} sweeps\n{dropped}")
    blocks = [[k for k, t in enumerate(recording.trials) if t.name.startswith(f"block{b}")] for b in (1, 2)]
    fitted, beside, second = blocks[0][::2], blocks[0][1::2], blocks[1]
    began = perf_counter()
    diagnosis = diagnose(recording.select(fitted), Twin.of(load("three_cable")), SETTINGS)
    spent = perf_counter() - began
    bench = prepare(recording, load("three_cable"))
    base, slack, said = with_dead_band(bench, fitted)
    claimed = [c.effect for c in diagnosis.claims]
    lines = []
    for name, rows in (("the other sweeps of block 1", beside), ("block 2", second)):
        before, after = tip_error(diagnosis.calibrated, bench, rows), tip_error(diagnosis.twin, bench, rows)
        not_claimed = _share(tip_error(base, bench, rows), tip_error(slack, bench, rows))
        told = f"{_share(before, after)}; with {DEAD_BAND} put in by hand {not_claimed}"
        lines.append(
            Row(f"three-cable, tip error on {name}", "<= 70 %", "<= 50 %", told, after <= 0.7 * before, after <= 0.5 * before)
        )
    found = DEAD_BAND in claimed
    small = [c for c in diagnosis.below_materiality if c.effect == DEAD_BAND]
    if small:
        gap = small[0].parameters["gap"]
        said += f"; as diagnosed {5e2 * gap.value:.2f} +- {5e2 * (gap.std or 0.0):.2f} mm, below materiality"
    nearest = ", ".join(c.effect for c in diagnosis.runners_up)
    lines.append(
        Row(
            "three-cable, the dead band found and named",
            "named",
            "",
            f"claimed: {claimed or 'none'}; weighed: {nearest}; {said}",
            found,
        )
    )
    lines.append(Row("three-cable, what the error moves with named", "named", "", f"claimed: {claimed or 'none'}", bool(claimed)))
    lines.append(
        Row("three-cable, diagnosis", "<= 5 min", "<= 1 min", f"{spent:.0f} s, {diagnosis.verdict}", spent <= 300, spent <= 60)
    )
    return lines, recording, diagnosis


def with_dead_band(bench: Bench, rows: Sequence[int]) -> tuple[Twin, Twin, str]:
    """The calibrated robot; the same with a dead band in its drives fitted beside its own parameters; the dead band in words."""
    model, objective, _ = objective_of(bench, Twin.of(bench.robot), list(rows), SETTINGS)
    base = fit(objective, model)
    law = named(DEAD_BAND)
    start = law.guesses[0]
    names = tuple(p.name for p in law.parameters if p.name not in law.richer)
    fuller: Model = base.model.with_effect(DEAD_BAND, start, names, bench.n_tendon)
    found = fit(objective, fuller, near=base.evaluation)
    gap = found.fitted(DEAD_BAND)["gap"]
    return base.model.twin, found.model.twin, f"dead band {5e2 * gap.value:.2f} +- {5e2 * (gap.std or 0.0):.2f} mm of cable"


def tip_error(twin: Twin, bench: Bench, rows: Sequence[int]) -> float:
    """RMS distance (mm); NaN where a pose has no equilibrium."""
    try:
        traces = simulate(twin, bench, trials=list(rows))
    except SolveError:
        return float("nan")
    off = [bench.measured[k] - readings(bench, report(twin.effects, t.true)) for k, t in zip(rows, traces, strict=True)]
    return float(1e3 * np.sqrt(np.mean(np.concatenate([(r**2).sum(axis=1) for r in off]))))


def _share(before: float, after: float) -> str:
    return f"{before:.2f} -> {after:.2f} mm ({100 * after / before:.0f} %)"
