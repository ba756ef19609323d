"""The cable tool: diagnosed on two loads and two rates, tested at the other loads and the fastest rate.

The bars are held against the calibrated linear transmission, a = a_0 + ratio q by least squares on the runs that are fitted. The
twin's own calibrated robot, which has elastic tendons already, is told beside it.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.benchmarks.hardware.comparisons.row import Row
from tools.benchmarks.hardware.importers import cable_tool
from twin.diagnosis import Diagnosis, Settings, diagnose
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import Objective
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.measurements import Recording, Trial
from twin.prediction.evaluate import evaluate
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

FITTED = {("load20", "0.1Hz"), ("load30", "0.1Hz"), ("load20", "0.3Hz"), ("load30", "0.3Hz")}
FRICTION_EFFECTS = {"tendon_friction", "joint_friction"}  # while no cable falls slack no data tell one from the other
TESTED_LOADS, TESTED_RATE = ("load10", "load40"), "0.5Hz"


def compare(folder: Path) -> tuple[list[Row], Recording, Diagnosis]:
    recording, dropped = cable_tool.read(folder)
    print(f"cable_tool: {len(recording.trials)} runs\n{dropped}")
    fitted, tested = split(recording)
    began = time.perf_counter()
    found = diagnose(fitted, Twin.of(load("cable_tool")), Settings(jobs=1))
    took = time.perf_counter() - began
    drum, jaw = (np.concatenate([t.values[f"joint_{j}_angle"] for t in fitted.trials]) for j in (1, 2))
    linear = np.polyfit(drum, jaw, 1)
    off = [np.polyval(linear, t.values["joint_1_angle"]) - t.values["joint_2_angle"] for t in tested.trials]
    straight = float(np.rad2deg(np.sqrt(np.mean(np.concatenate(off) ** 2))))
    calibrated, after = (evaluate(twin, tested)["rmse"] for twin in (found.calibrated, found.twin))
    share = after / straight
    widths = loops(recording, found.twin.predict(recording))
    worst = max(abs(modelled / measured - 1.0) for measured, modelled in widths.values())
    told = ", ".join(f"{name[4:]} %: {measured:.1f}/{modelled:.1f}" for name, (measured, modelled) in widths.items())
    claimed = {c.effect for c in found.claims}
    named = bool(claimed & FRICTION_EFFECTS) and bool(claimed & {"tendon_elasticity", "tendon_backlash"})
    alone = ", ".join(f"{c.effect} {np.rad2deg(c.error):.2f}" for c in found.claims)
    return [
        Row(
            "cable tool, output angle RMS, other loads and rate: linear -> twin", "<= 50 %", "<= 30 %",
            f"{straight:.2f} -> {after:.2f} deg ({100 * share:.0f} %)", share <= 0.5, share <= 0.3,
        ),
        Row("  of the twin's calibrated robot, with elastic tendons", "", "", f"{calibrated:.2f} deg", None),
        Row("  loop width by load, measured/twin, deg", "within 25 %", "within 10 %", told, worst <= 0.25, worst <= 0.1),
        Row("  effects named", "friction, slack or elasticity", "", f"{found.verdict}: {', '.join(sorted(claimed))}", named),
        Row("  the same without one of them, deg, held-out run of the fitted", "", "", alone, None),
        Row("  other tools, ratio and zero fitted at 20 %, at 80 %: linear -> twin", "", "", _others(folder, found), None),
        Row("  time of the diagnosis", "<= 5 min", "<= 1 min", f"{took:.1f} s", took <= 300, took <= 60),
    ], fitted, found  # fmt: skip


def _others(folder: Path, found: Diagnosis) -> str:
    """The error under a load twice the largest that was fitted, on tools of which only ratio and encoder zero are fitted."""
    told = []
    for tool in cable_tool.MIRRORED_TOOLS:
        runs = cable_tool.read_other(folder, tool)
        light, heavy = runs.trials
        linear = np.polyfit(light.values["joint_1_angle"], light.values["joint_2_angle"], 1)
        straight = np.polyval(linear, heavy.values["joint_1_angle"]) - heavy.values["joint_2_angle"]
        twin = _refitted(found.twin, replace(runs, trials=(light,)))
        after = evaluate(twin, replace(runs, trials=(heavy,)))["rmse"]
        told.append(f"{np.rad2deg(np.sqrt(np.mean(straight**2))):.2f} -> {after:.2f}")
    return ", ".join(told) + " deg"


def objective_of(twin: Twin, recording: Recording) -> Objective:
    """Return the objective of fits to all runs of a recording, whose noise is how the motors' encoders repeat."""
    bench = prepare(recording, twin.robot)
    nothing = [np.zeros((*y.shape, bench.n_tendon)) for y in bench.measured]
    noise = Noise(np.full(1, cable_tool.REPEATS), np.zeros(bench.n_tendon), np.zeros(1), "repeats")
    whitener = Whitener(noise, bench.measured, nothing, [i.command for i in bench.inputs])
    return Objective(bench, range(len(bench.inputs)), whitener, 1)


def _refitted(twin: Twin, recording: Recording) -> Twin:
    """The twin with its pulley's radius and its encoder's zero fitted to a recording."""
    free = tuple(f for f in Model.base(twin.robot, twin).free if f.parameter.name in ("pulley.radius", "jaw.rest"))
    return fit(objective_of(twin, recording), Model(twin, free)).model.twin


def split(recording: Recording) -> tuple[Recording, Recording]:
    """The runs a diagnosis sees, and those it is tested on."""

    def only(wanted: Callable[[str, str], bool]) -> Recording:
        return replace(recording, trials=tuple(t for t in recording.trials if wanted(*kind(t))))

    seen = only(lambda load, rate: (load, rate) in FITTED)
    return seen, only(lambda load, rate: load in TESTED_LOADS or rate == TESTED_RATE)


def kind(trial: Trial) -> tuple[str, str]:
    """Load and rate of a run, as its name has them."""
    load, _, rate = trial.name.removesuffix(".csv").partition("_")
    return load, rate


def loops(measured: Recording, predicted: Recording) -> dict[str, tuple[float, float]]:
    """By load the mean widths (deg) of the measured and of the predicted loop."""
    found: dict[str, list[tuple[float, float]]] = {}
    for a, b in zip(measured.trials, predicted.trials, strict=True):
        found.setdefault(kind(a)[0], []).append((width(a), width(replace(a, values={**a.values, **b.values}))))
    return {name: (float(np.mean([m for m, _ in each])), float(np.mean([p for _, p in each]))) for name, each in found.items()}


def width(trial: Trial) -> float:
    """How far the way there and the way back lie apart at the middle of the stroke, deg."""
    q, angle = trial.values["joint_1_angle"], trial.values["joint_2_angle"]
    rising = np.gradient(q) > 0
    middle = np.abs(q - 0.5 * (q.min() + q.max())) < 0.1 * np.ptp(q)
    line = np.polyfit(q[middle], angle[middle], 1)
    off = angle - np.polyval(line, q)
    return float(np.rad2deg(abs(off[rising & middle].mean() - off[~rising & middle].mean())))
