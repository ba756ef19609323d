"""The three-cable robot: alternate sweeps of one block fitted; the other sweeps of that block and the other block tested."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from tools.comparisons.row import Row
from tools.importers import three_cable
from twin.bench import Bench, prepare
from twin.calibrate import fit
from twin.diagnose import Diagnosis, Settings, diagnose
from twin.diagnose.objective import objective_of
from twin.effects import named
from twin.errors import SolveError
from twin.measurements import Recording
from twin.robots import load
from twin.twin import Twin, readings, report, simulate

SETTINGS = Settings(jobs=1)
PLAY = "tendon_backlash"
BY_HAND = ("transmission_error", "tendon_friction", PLAY)
DEAD_BAND = {PLAY, "tendon_friction"}  # play, or a cable that sticks before it slides


def compare(folder: Path) -> tuple[list[Row], Recording, Diagnosis]:
    """The rows of both directions, and the diagnosis of the first block."""
    recording, dropped = three_cable.read(folder)
    print(f"three_cable: {len(recording.trials)} sweeps\n{dropped}")
    bench = prepare(recording, load("three_cable"))
    lines, first = [], None
    for block in (1, 2):
        fitted, beside, other = halves(recording, block)
        began = perf_counter()
        diagnosis = diagnose(recording.select(fitted), Twin.of(load("three_cable")), SETTINGS)
        spent = perf_counter() - began
        first = first or diagnosis
        base, by_hand, said = with_all(bench, fitted)
        for name, rows in ((f"the other sweeps of block {block}", beside), (f"block {3 - block}", other)):
            before, after = tip_error(diagnosis.calibrated, bench, rows), tip_error(diagnosis.twin, bench, rows)
            hand = _share(tip_error(base, bench, rows), tip_error(by_hand, bench, rows))
            what = f"three-cable, fitted to block {block}, tip error on {name}"
            told = f"{_share(before, after)}; by hand {hand}"
            lines.append(Row(what, "<= 70 %", "<= 50 %", told, after <= 0.7 * before, after <= 0.5 * before))
        claimed = {c.effect for c in diagnosis.claims}
        small = ", ".join(c.effect for c in diagnosis.below_materiality)
        nearest = ", ".join(c.effect for c in diagnosis.runners_up)
        told = f"claimed: {', '.join(sorted(claimed)) or 'none'}; too small to claim: {small or 'none'}; weighed: {nearest}; {said}"
        lines.append(
            Row(f"three-cable, block {block}, the dead band found and named", "named", "", told, bool(claimed & DEAD_BAND))
        )
        told = f"{spent:.0f} s, {diagnosis.verdict}"
        lines.append(Row(f"three-cable, diagnosis of block {block}", "<= 5 min", "<= 1 min", told, spent <= 300, spent <= 60))
    assert first is not None
    return lines, recording, first


def halves(recording: Recording, block: int) -> tuple[list[int], list[int], list[int]]:
    """Fitted sweeps of a block, its others, and those of the other block.

    In block 2 sweeps of cable 3 and of cable 2 take turns, so that two are fitted and two are not.
    """
    own = [k for k, t in enumerate(recording.trials) if t.name.startswith(f"block{block}")]
    fitted = [k for i, k in enumerate(own) if i // block % 2 == 0]
    return fitted, [k for k in own if k not in fitted], [k for k in range(len(recording.trials)) if k not in own]


def with_all(bench: Bench, rows: Sequence[int]) -> tuple[Twin, Twin, str]:
    """The calibrated robot; the same with `BY_HAND` fitted beside its own parameters, one after the other; friction and play in
    words."""
    model, objective, _ = objective_of(bench, Twin.of(bench.robot), list(rows), SETTINGS)
    base = found = fit(objective, model, refresh=True)
    for name in BY_HAND:
        predicted = [t.true for t in found.evaluation.traces.values()]
        begun = list(named(name).starts(predicted, bench.n_tendon))
        found = min(
            (fit(objective, found.model.with_effect(name, s.values, s.free, bench.n_tendon)) for s in begun), key=lambda f: f.cost
        )
    friction, play = found.fitted("tendon_friction"), found.fitted(PLAY)
    mu, slide, (where, gap) = friction["mu"], friction["presliding"], next(p for p in play.items() if p[0].startswith("gap"))
    slid, slid_std, wide, wide_std = (1e3 * (v or 0.0) for v in (slide.value, slide.std, gap.value, gap.std))
    said = f"mu {mu.value:.2f} +- {mu.std or 0.0:.2f}, sliding after {slid:.1f} +- {slid_std:.1f} mm"
    return base.model.twin, found.model.twin, f"by hand: {said}, {where} {wide:.2f} +- {wide_std:.2f} mm of cable"


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
