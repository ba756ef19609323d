"""The soft tentacle: leave one hold out, single tendons against both, and the learned remainder."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from tools.benchmarks.hardware.comparisons.row import SETTINGS, Row
from tools.benchmarks.hardware.importers import tentacle
from tools.benchmarks.hardware.residual_gp import Remainder
from twin.diagnosis import Claim, Diagnosis, diagnose
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import fit
from twin.foundation.parameters import Values
from twin.measurements import Recording
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

HOOKE = {"backbone.stiffening": 0.0}


def compare(folder: Path) -> tuple[list[Row], Recording, Diagnosis]:
    recording, dropped = tentacle.read(folder)
    print(f"tentacle: {len(recording.trials)} holds\n{dropped}\n  {recording.notices[0]}")
    bench = prepare(recording, load("tentacle"))
    began = perf_counter()
    diagnosis = diagnose(recording, Twin.of(bench.robot), SETTINGS)
    spent = perf_counter() - began
    pulls = np.stack([i.command[0] for i in bench.inputs])
    n, both = len(pulls), np.flatnonzero((pulls > 0).all(axis=1))
    alone = np.setdiff1d(np.arange(n), both)
    left, learned = np.empty((n, 12)), np.empty((n, 12))
    noise = np.array([o.channel.noise for o in bench.outputs[:12]])  # the four markers', as put on first
    for k in range(n):
        others = np.delete(np.arange(n), k)
        twin = calibrated(bench, others, diagnosis.claims)
        left[k] = residual(bench, twin, [k])[0]
        learned[k] = left[k] - Remainder.fit(pulls[others], residual(bench, twin, others), noise).predict(pulls[[k]])[0]
    hooke, soft = (residual(bench, calibrated(bench, alone, values=values), both) for values in (HOOKE, {}))
    of_single = diagnose(recording.select(alone), Twin.of(bench.robot), SETTINGS)
    two = mean_error(residual(bench, calibrated(bench, alone, of_single.claims), both))
    whole, with_remainder = mean_error(left), mean_error(learned)
    gain = 1.0 - mean_error(soft) / mean_error(hooke)
    return [
        Row(
            "tentacle, leave one of 22 holds out, effects chosen on 16 of them, mean marker error", "<= 5.0 mm", "<= 4 mm",
            f"{whole:.2f} +- {standard_error(left):.2f} mm", whole <= 5.0, whole <= 4.0,
        ),
        Row("  by marker, base to tip", "", "", ", ".join(f"{e:.1f}" for e in by_marker(left)) + " mm", None),
        Row(
            "  with the learned remainder", "<= 4.5 mm", "<= 3.5 mm", f"{with_remainder:.2f} +- {standard_error(learned):.2f} mm",
            with_remainder <= 4.5, with_remainder <= 3.5,
        ),
        Row(
            "tentacle, single-tendon holds -> two-tendon holds", "<= 6 mm", "<= 5 mm",
            f"{two:.2f} mm; calibrated alone {mean_error(soft):.2f}, {100 * gain:.0f} % below Hooke's {mean_error(hooke):.2f}",
            two <= 6.0, two <= 5.0,
        ),
        Row("tentacle, diagnosis", "<= 60 s", "<= 30 s", f"{spent:.0f} s, {diagnosis.verdict}", spent <= 60, spent <= 30),
    ], recording, diagnosis  # fmt: skip


def calibrated(
    bench: PreparedRecording, rows: Sequence[int] | np.ndarray, claims: Sequence[Claim] = (), values: Values | None = None
) -> Twin:  # fmt: skip
    """The robot's own parameters, and the sizes of the effects claimed, fitted to these holds."""
    model, objective, _ = objective_of(bench, replace(Twin.of(bench.robot), values=values or {}), [int(k) for k in rows], SETTINGS)
    for claim in claims:
        found = {name: fitted.value for name, fitted in claim.parameters.items()}
        model = model.with_effect(claim.effect, found, tuple(found), bench.n_tendon)
    return fit(objective, model).model.twin


def residual(bench: PreparedRecording, twin: Twin, rows: Sequence[int] | np.ndarray) -> np.ndarray:
    """Measured less predicted (n_hold, 12) m, means over each hold, of the markers it was seen with."""
    rows = [int(k) for k in rows]
    traces = simulate(twin, bench, trials=rows)
    off = [bench.measured[k] - t.outputs(twin, bench) for k, t in zip(rows, traces, strict=True)]
    return tentacle.joined(np.stack([r.mean(axis=0) for r in off]))


def by_marker(off: np.ndarray) -> np.ndarray:
    """Mean distance (4,) mm over the holds."""
    return 1e3 * np.linalg.norm(off.reshape(-1, 4, 3), axis=2).mean(axis=0)


def mean_error(off: np.ndarray) -> float:
    return float(by_marker(off).mean())


def standard_error(off: np.ndarray) -> float:
    """Of `mean_error`, mm, as if holds were drawn at random from all that might have been taken."""
    of_holds = 1e3 * np.linalg.norm(off.reshape(-1, 4, 3), axis=2).mean(axis=1)
    return float(of_holds.std(ddof=1) / np.sqrt(len(of_holds)))
