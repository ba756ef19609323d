"""The error of a given twin on given data; fits nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from twin.bench import Bench, prepare
from twin.measurements import Recording
from twin.twin import Twin, is_dynamic, readings, report, simulate

UNIT = {  # group of outputs -> unit it is shown in, factor from SI
    "marker": ("mm", 1e3), "displacement": ("mm", 1e3), "tension": ("N", 1.0), "temperature": ("K", 1.0),
    "resistance": ("ohm", 1.0), "sensor": ("ohm", 1.0), "angle": ("deg", 180.0 / np.pi), "torque": ("N*m", 1.0),
    "skin": ("mm", 1e3),
}  # fmt: skip
KIND = {  # group of outputs -> kind in reports
    "marker": "position", "displacement": "tendon_displacement", "tension": "tendon_tension", "temperature": "sma_temperature",
    "resistance": "sma_resistance", "sensor": "sensor_resistance", "angle": "joint_angle", "torque": "joint_torque",
    "skin": "skin",
}  # fmt: skip

POINTS = ("marker",)  # groups whose channels are the x, y and z of points
ACCURATE = ("marker", "skin", "angle")  # groups that a robot's declared accuracy speaks of
TYPICAL = {  # group of outputs -> noise (SI) of a usual sensor, where nothing is known yet
    "marker": 2.5e-4, "displacement": 5e-5, "tension": 2e-2, "temperature": 0.5, "resistance": 5e-3, "sensor": 0.5,
    "angle": 2e-3, "torque": 1e-3, "skin": 2e-4,
}  # fmt: skip


def headline(groups: Iterable[str]) -> str:
    """The group of outputs whose error stands for the twin: markers where there are any, else skin, else the first."""
    groups = list(groups)
    return next((g for g in ("marker", "skin") if g in groups), groups[0])


def squares(bench: Bench, raw: Sequence[np.ndarray], group: str) -> list[np.ndarray]:
    """Squared errors of a group, one array a trial: per sample and complete marker (Euclidean), or per sample and channel."""
    out = []
    for r in raw:
        if group == "marker":
            markers = dict.fromkeys(o.index for o in bench.outputs if o.group == "marker")
            columns = [[j for j, o in enumerate(bench.outputs) if o.group == "marker" and o.index == m] for m in markers]
            found = np.concatenate([(r[:, c] ** 2).sum(axis=1) for c in columns])
        else:
            found = r[:, [j for j, o in enumerate(bench.outputs) if o.group == group]].ravel() ** 2
        out.append(found[np.isfinite(found)])
    return out


def rms(bench: Bench, raw: Sequence[np.ndarray], group: str) -> float:
    """Root-mean-square of residuals (n_k, n_output) of one group, SI; NaN where nothing was measured."""
    found = np.concatenate(squares(bench, raw, group))
    return float(np.sqrt(found.mean())) if found.size else float("nan")


def evaluate(twin: Twin, recording: Recording) -> dict[str, Any]:
    """The `error` block of the report contract for one twin: unit, trials, rmse (of positions where there are any), by_kind,
    by_channel (root-mean-square of the channel alone). Raises TwinError for data the twin cannot be compared with."""
    bench = prepare(recording, twin.robot)
    traces = simulate(twin, bench, dynamic=is_dynamic(bench))
    raw = [y - readings(bench, report(twin.effects, t.true)) for y, t in zip(bench.measured, traces, strict=True)]
    groups = list(dict.fromkeys(o.group for o in bench.outputs))
    by_kind = {KIND[g]: {"unit": UNIT[g][0], "rmse": _or_none(UNIT[g][1] * rms(bench, raw, g))} for g in groups}
    everything = np.concatenate(raw)
    by_channel = {
        o.channel.name: {"unit": UNIT[o.group][0], "rmse": _or_none(UNIT[o.group][1] * _channel_rms(everything[:, j]))}
        for j, o in enumerate(bench.outputs)
    }
    first = by_kind[KIND[headline(groups)]]
    return {"trials": [t.label for t in recording.trials], **first, "by_kind": by_kind, "by_channel": by_channel}


def _channel_rms(r: np.ndarray) -> float:
    r = r[np.isfinite(r)]
    return float(np.sqrt(np.mean(r**2))) if r.size else float("nan")


def _or_none(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
