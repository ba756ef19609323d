"""The three-cable robot: alternate sweeps of one block fitted; the other sweeps of that block and the other block tested; and what
was fitted to the first three quarters of the experiment, on the last one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from tools.comparisons.row import Row
from tools.importers import three_cable
from twin.bench import Bench, prepare
from twin.calibrate import Fit, Free, Model, Objective, fit
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
ROPES = ("constructional_stretch", "transmission_error")
REGISTERED = 4  # sweeps by which the camera is registered anew
EARLY = 0.775  # of the sweeps
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
        soft, ropes = giving_way(bench, fitted)
        for name, rows in ((f"the other sweeps of block {block}", beside), (f"block {3 - block}", other)):
            before, after = tip_error(diagnosis.calibrated, bench, rows), tip_error(diagnosis.twin, bench, rows)
            hand = _share(tip_error(base, bench, rows), tip_error(by_hand, bench, rows))
            what = f"three-cable, fitted to block {block}, tip error on {name}"
            told = f"{_share(before, after)}; by hand {hand}"
            lines.append(Row(what, "<= 70 %", "<= 50 %", told, after <= 0.7 * before, after <= 0.5 * before))
        spread = [other[int(k)] for k in np.linspace(0, len(other) - 1, REGISTERED + 2)[1:-1].round()]
        unseen = [k for k in other if k not in spread]
        pairs = ((diagnosis.calibrated, diagnosis.twin), (soft, ropes))
        lines.append(_registered(f"three-cable, fitted to block {block}, block {3 - block}", bench, spread, unseen, pairs))
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
    n = round(EARLY * len(recording.trials))
    fitted, later = list(range(0, n, 2)), list(range(n, len(recording.trials)))
    diagnosis = diagnose(recording.select(fitted), Twin.of(load("three_cable")), SETTINGS)
    pairs = ((diagnosis.calibrated, diagnosis.twin), giving_way(bench, fitted))
    what = f"three-cable, fitted to the first {n} sweeps, later ones"
    lines.append(_registered(what, bench, later[:REGISTERED], later[REGISTERED:], pairs))
    return lines, recording, first


def _registered(
    what: str, bench: Bench, by: Sequence[int], rows: Sequence[int], pairs: Sequence[tuple[Twin, Twin]]
) -> Row:  # fmt: skip
    """The error before and after, the camera registered anew by some sweeps; of the diagnosis, and by hand."""
    (before, after), hand = ([tip_error(registered(t, bench, by), bench, rows) for t in pair] for pair in pairs)
    told = f"{_share(before, after)}; ropes that bed in and drives, by hand {_share(*hand)}"
    return Row(f"{what}, camera registered anew", "<= 75 %", "<= 50 %", told, after <= 0.75 * before, after <= 0.5 * before)


def registered(twin: Twin, bench: Bench, rows: Sequence[int]) -> Twin:
    """With the camera's frame alone fitted anew to these sweeps."""
    _, objective, _ = objective_of(bench, twin, list(rows), SETTINGS)
    frame = [p for p in bench.robot.nuisance if p.name.startswith("frame.")]
    return fit(objective, Model(twin, tuple(Free(None, p) for p in frame))).model.twin


def giving_way(bench: Bench, rows: Sequence[int]) -> tuple[Twin, Twin]:
    """The calibrated robot, how hard it is to bend against how hard to press being free too, since that shows where ropes give way;
    and with `ROPES` beside, one after the other."""
    thick = {p.name: replace(p, std=1.5e-3, low=1e-3, high=12e-3) for p in bench.robot.parameters if "backbone.radius" in p.name}
    robot = replace(bench.robot, parameters=tuple(thick.get(p.name, p) for p in bench.robot.parameters))
    model, objective, _ = objective_of(replace(bench, robot=robot), Twin.of(robot), list(rows), SETTINGS)
    base = found = fit(objective, model, refresh=True)
    for name in ROPES:
        found = _with(objective, found, name, bench.n_tendon)
    return base.model.twin, found.model.twin


def _with(objective: Objective, found: Fit, name: str, n_tendon: int) -> Fit:
    """One effect more, from the best of its starts."""
    predicted = [t.true for t in found.evaluation.traces.values()]
    begun = named(name).starts(predicted, n_tendon)
    return min((fit(objective, found.model.with_effect(name, s.values, s.free, n_tendon)) for s in begun), key=lambda f: f.cost)


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
        found = _with(objective, found, name, bench.n_tendon)
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
