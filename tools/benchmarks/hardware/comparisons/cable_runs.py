"""Any folder of cable tool runs: each tool and pose fitted at two loads and judged at all its other ones.

What is fitted is the law that the tools of development follow, capstan friction and elastic cables that bed in, from what those
showed (`MAKE`); nothing is chosen on the runs judged. The bars are held against a = a_0 + ratio q + compliance tau by least
squares on the same runs.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.benchmarks.hardware.comparisons.cable_tool import loops, objective_of
from tools.benchmarks.hardware.comparisons.row import Row
from tools.benchmarks.hardware.importers import cable_tool
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.calibration.model import Free, Model
from twin.diagnosis.calibration.objective import PARAMETER_DIFFERENCE
from twin.effects import effect_class
from twin.measurements import Recording
from twin.prediction.evaluate import evaluate
from twin.prediction.twin import Twin
from twin.robots import load

FITTED_PERCENTS = (20, 60)  # per cent, fitted
LOOP_WIDTH_ERROR = 0.3  # of a loop's width: the bar
FIT_ROUNDS = 4  # of a fit: derivatives of the robot's own numbers are taken once in each, and here they bend
# Value and spread on the tools of development (R_5, L_Roll_3, L_Pitch_3): what another of the make is believed to have.
MAKE = {
    "tendon_friction": {"mu": (0.010, 0.005), "presliding": (3e-5, 3e-5)},
    "tendon_elasticity": {"toe": (4e-4, 2e-4), "toe_tension": (2.0, 1.0)},
}


def compare(folder: Path, asked: Sequence[int] = FITTED_PERCENTS) -> list[Row]:
    """The rows of every tool and pose below `folder` that has runs at both fitted loads (or the nearest to them) and at others."""
    lines = []
    for recording in cable_tool.read_all(folder):
        loads = sorted({percent(t.name) for t in recording.trials})
        if len(loads) < 2:
            lines.append(Row(recording.title, "", "", f"{loads[0]} % load alone: two loads are needed to fit", None))
            continue
        first = min(loads, key=lambda x: abs(x - asked[0]))
        second = min((x for x in loads if x != first), key=lambda x: abs(x - asked[1]))
        lines += judged(recording, {first, second})
    return lines


def judged(recording: Recording, chosen: set[int]) -> list[Row]:
    """The rows of one tool, fitted at the loads chosen."""
    fitted, other = (
        replace(recording, trials=tuple(t for t in recording.trials if (percent(t.name) in chosen) is inside))
        for inside in (True, False)
    )
    found = refitted(make(), fitted)
    twin = found.model.twin
    told = f"fitted at {' and '.join(str(c) for c in sorted(chosen))} %"
    inside = f"{linear(fitted, fitted):.2f} -> {evaluate(twin, fitted)['rmse']:.2f} deg"
    lines = [Row(f"{recording.title}, {told}: linear + load -> twin", "", "", inside, None)]
    if other.trials:
        before, after = linear(fitted, other), evaluate(twin, other)["rmse"]
        share = after / before
        judged = f"{before:.2f} -> {after:.2f} deg ({100 * share:.0f} %)"
        lines.append(Row("  at the other loads", "<= 60 %", "<= 35 %", judged, share <= 0.6, share <= 0.35))
        lines.append(Row("  by load", "", "", _by_load(twin, fitted, other), None))
    lines.append(_loops(found, recording))
    return lines


def _loops(found: Fit, recording: Recording) -> Row:
    """How wide loops are at every load. Where two standard errors of a predicted width are more than the bar allows the fit itself
    says that it does not tell: such a load is shown, and not judged, and the bar is not called met."""
    widths, open_ = loops(recording, found.model.twin.predict(recording)), loop_errors(found, recording)
    told = [abs(b / a - 1.0) for name, (a, b) in widths.items() if 2.0 * open_[name] <= LOOP_WIDTH_ERROR * b]
    shown = ", ".join(
        f"{name[4:]} %: {a:.1f}/{b:.1f}" + (f" +- {open_[name]:.1f}, not told" if 2.0 * open_[name] > LOOP_WIDTH_ERROR * b else "")
        for name, (a, b) in widths.items()
    )
    worst, whole = max(told, default=0.0), len(told) == len(widths)
    met = False if worst > LOOP_WIDTH_ERROR else True if whole else None
    what = "  loop width by load, measured/twin, deg"
    return Row(what, f"within {100 * LOOP_WIDTH_ERROR:.0f} %", "within 12 %", shown, met, whole and worst <= 0.12)


def loop_errors(found: Fit, recording: Recording) -> dict[str, float]:
    """By load one standard error (deg) of the predicted width: sqrt(g' H^-1 g), g its derivatives by the free parameters and H the
    fit's information with what was believed beforehand."""
    model, x = found.model, found.model.vector()
    here, slopes = loops(recording, model.twin.predict(recording)), []
    for n, free in enumerate(model.free):
        size = (
            PARAMETER_DIFFERENCE
            if (x[n] + PARAMETER_DIFFERENCE) * free.parameter.step <= free.parameter.high
            else -PARAMETER_DIFFERENCE
        )
        moved = loops(recording, model.at(x + size * np.eye(len(x))[n]).twin.predict(recording))
        slopes.append([(moved[name][1] - here[name][1]) / size for name in here])
    g = np.array(slopes)
    return dict(zip(here, np.sqrt(np.einsum("ik,ij,jk->k", g, np.linalg.pinv(found.information()), g)), strict=True))


def _by_load(twin: Twin, fitted: Recording, other: Recording) -> str:
    """Load by load: linear + load -> twin, and whether it lies inside what was fitted or beyond."""
    ends = [percent(t.name) for t in fitted.trials]
    told = []
    for each in sorted({percent(t.name) for t in other.trials}):
        runs = replace(other, trials=tuple(t for t in other.trials if percent(t.name) == each))
        where = "inside" if min(ends) < each < max(ends) else "beyond"
        told.append(f"{each} % ({where}): {linear(fitted, runs):.2f} -> {evaluate(twin, runs)['rmse']:.2f}")
    return ", ".join(told)


def percent(name: str) -> int:
    """The load of a run, as its name has it."""
    return int(name.removeprefix("load").partition("_")[0])


def linear(fitted: Recording, judged: Recording) -> float:
    """RMS error (deg) on the runs judged of a = a_0 + ratio q + compliance tau, least squares on those fitted."""

    def rows(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
        q, tau, a = (
            np.concatenate([t.values[name] for t in recording.trials])
            for name in ("joint_1_angle", "joint_2_torque", "joint_2_angle")
        )
        return np.column_stack([np.ones_like(q), q, tau]), a

    A, a = rows(fitted)
    B, b = rows(judged)
    return float(np.rad2deg(np.sqrt(np.mean((b - B @ np.linalg.lstsq(A, a, rcond=None)[0]) ** 2))))


def make() -> Twin:
    """The tool as described, with the law of its make."""
    effects = tuple(effect_class(effect)({name: value for name, (value, _) in law.items()}, 2) for effect, law in MAKE.items())
    return Twin(load("cable_tool"), {}, effects)


def refitted(twin: Twin, recording: Recording) -> Fit:
    """The robot's own numbers and those of its law fitted to a recording, each held by what is believed of it."""
    objective = objective_of(twin, recording)
    tables = {effect: {p.name: p for p in effect_class(effect).all_parameters(2)} for effect in MAKE}
    law = tuple(
        Free(effect, replace(tables[effect][name], value=value, std=spread))
        for effect, numbers in MAKE.items()
        for name, (value, spread) in numbers.items()
    )
    model = Model(twin, (*Model.base(twin.robot).free, *law))
    found = fit(objective, model, refresh=True)
    for _ in range(FIT_ROUNDS - 1):
        found = fit(objective, found.model, refresh=True)
    return found
