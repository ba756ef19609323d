"""The three-cable robot: alternate sweeps of one block fitted; the other sweeps of that block and the other block tested; and what
was fitted to the first three quarters of the experiment, on the last one."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import comb
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.spatial.transform import Rotation

from tools.benchmarks.hardware.comparisons.row import SETTINGS, Row
from tools.benchmarks.hardware.importers import three_cable
from twin.diagnosis import Diagnosis, diagnose
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.calibration.objective import Objective
from twin.effects import effect_class
from twin.effects.base.scaling import scaled_starts
from twin.foundation.errors import SolveError
from twin.measurements import Recording
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

PLAY = "tendon_backlash"
EFFECTS_BY_HAND = ("transmission_error", "tendon_friction", PLAY)
ROPES = ("tendon_elasticity", "transmission_error")
REGISTERED = 4  # sweeps by which the camera is registered anew
MOST_CHOICES = 200  # of choosing them, at most
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
        pairs = ((diagnosis.calibrated, diagnosis.twin), (soft, ropes))
        lines.append(_registered(f"three-cable, fitted to block {block}, block {3 - block}", bench, other, pairs))
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
    lines.append(_registered(what, bench, later, pairs))
    return lines, recording, first


def _registered(what: str, bench: PreparedRecording, rows: Sequence[int], pairs: Sequence[tuple[Twin, Twin]]) -> Row:
    """The errors before and after on unseen sweeps, the camera registered anew by `REGISTERED` of them, the others judged; of the
    diagnosis, and by hand. Which sweeps register it decides much: in the median of the ways, and by the first sweeps alone."""
    diagnosed, hand = (np.array([errors_registered(t, bench, rows) for t in pair]) for pair in pairs)
    share = diagnosed[1] / diagnosed[0]
    low, middle, high = np.quantile(share, [0.1, 0.5, 0.9])
    told = (
        f"{_medians(diagnosed)}, nine of ten ways {100 * low:.0f} to {100 * high:.0f} %, by the first {REGISTERED} "
        f"{100 * share[0]:.0f} %; ropes that bed in and drives, by hand {_medians(hand)}"
    )
    return Row(f"{what}, camera registered anew", "<= 75 %", "<= 50 %", told, middle <= 0.75, middle <= 0.5)


def _medians(errors: np.ndarray) -> str:
    """Of errors (2, n) before and after; the share is the median one too."""
    before, after = np.median(errors, axis=1)
    return f"{before:.2f} -> {after:.2f} mm ({100 * np.median(errors[1] / errors[0]):.0f} %)"


def ways(n: int) -> list[tuple[int, ...]]:
    """To choose `REGISTERED` of n sweeps: the first ones first, then all others, or `MOST_CHOICES` drawn ones."""
    first = tuple(range(REGISTERED))
    if comb(n, REGISTERED) <= MOST_CHOICES:
        return [first, *(w for w in combinations(range(n), REGISTERED) if w != first)]
    rng = np.random.default_rng(0)
    return [first, *(tuple(int(k) for k in rng.choice(n, REGISTERED, replace=False)) for _ in range(MOST_CHOICES))]


def errors_registered(twin: Twin, bench: PreparedRecording, rows: Sequence[int]) -> np.ndarray:
    """RMS distance (mm) on the sweeps not chosen, for each of the `ways` to choose those by which the predicted tips are turned and
    shifted onto the measured ones (Kabsch, Acta Cryst. A32, 1976); NaN where a pose has no equilibrium."""
    try:
        tips = [t.outputs(twin, bench) for t in simulate(twin, bench, trials=list(rows))]
    except SolveError:
        return np.full(len(ways(len(rows))), np.nan)
    seen = [bench.measured[k] for k in rows]
    return np.array([_off(tips, seen, way) for way in ways(len(rows))])


def _off(tips: Sequence[np.ndarray], seen: Sequence[np.ndarray], way: Sequence[int]) -> float:
    a, b = (np.concatenate([x[k] for k in way]) for x in (tips, seen))
    turn = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))[0]
    rest = [k for k in range(len(tips)) if k not in way]
    left = np.concatenate([turn.apply(tips[k] - a.mean(axis=0)) + b.mean(axis=0) - seen[k] for k in rest])
    return float(1e3 * np.sqrt(np.mean((left**2).sum(axis=1))))


def giving_way(bench: PreparedRecording, rows: Sequence[int]) -> tuple[Twin, Twin]:
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
    begun = scaled_starts(effect_class(name), predicted, n_tendon, objective.prepared.robot.size)
    return min((fit(objective, found.model.with_effect(name, s.values, s.free, n_tendon)) for s in begun), key=lambda f: f.cost)


def halves(recording: Recording, block: int) -> tuple[list[int], list[int], list[int]]:
    """Fitted sweeps of a block, its others, and those of the other block.

    In block 2 sweeps of cable 3 and of cable 2 take turns, so that two are fitted and two are not.
    """
    own = [k for k, t in enumerate(recording.trials) if t.name.startswith(f"block{block}")]
    fitted = [k for i, k in enumerate(own) if i // block % 2 == 0]
    return fitted, [k for k in own if k not in fitted], [k for k in range(len(recording.trials)) if k not in own]


def with_all(bench: PreparedRecording, rows: Sequence[int]) -> tuple[Twin, Twin, str]:
    """The calibrated robot; the same with `EFFECTS_BY_HAND` fitted beside its own parameters, one after the other; friction and
    play in words."""
    model, objective, _ = objective_of(bench, Twin.of(bench.robot), list(rows), SETTINGS)
    base = found = fit(objective, model, refresh=True)
    for name in EFFECTS_BY_HAND:
        found = _with(objective, found, name, bench.n_tendon)
    friction, play = found.fitted("tendon_friction"), found.fitted(PLAY)
    mu, slide, (where, gap) = friction["mu"], friction["presliding"], next(p for p in play.items() if p[0].startswith("gap"))
    slid, slid_std, wide, wide_std = (1e3 * (v or 0.0) for v in (slide.value, slide.std, gap.value, gap.std))
    said = f"mu {mu.value:.2f} +- {mu.std or 0.0:.2f}, sliding after {slid:.1f} +- {slid_std:.1f} mm"
    return base.model.twin, found.model.twin, f"by hand: {said}, {where} {wide:.2f} +- {wide_std:.2f} mm of cable"


def tip_error(twin: Twin, bench: PreparedRecording, rows: Sequence[int]) -> float:
    """RMS distance (mm); NaN where a pose has no equilibrium."""
    try:
        traces = simulate(twin, bench, trials=list(rows))
    except SolveError:
        return float("nan")
    off = [bench.measured[k] - t.outputs(twin, bench) for k, t in zip(rows, traces, strict=True)]
    return float(1e3 * np.sqrt(np.mean(np.concatenate([(r**2).sum(axis=1) for r in off]))))


def _share(before: float, after: float) -> str:
    return f"{before:.2f} -> {after:.2f} mm ({100 * after / before:.0f} %)"
