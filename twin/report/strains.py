"""Strain loops: what the cords of a sealed trial felt as a tendon pulled and let go, beside what the twins say."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.report.plots import ACCENT, BEFORE, MOST_POINTS, Plot, figure, numbers, plain, thin
from twin.report.sentence import labels
from twin.report.stages import before_and_after
from twin.sensors import Cords, strain

COLOURS = ("#0f6b74", "#b9893a", "#7a4a8c", "#5a7d2a")  # of the cords that moved most
HEIGHT = 420
PERCENT = 100.0


def plot(d: Diagnosis) -> Plot | None:
    """Apparent strains kappa eps = sqrt(R / R0) - 1, R0 the trial's first reading, against the tendon that moves them most, of the
    sealed trial in which they move most: dots measured, lines predicted. None where the robot has no cords that were measured."""
    cords = [j for j, o in enumerate(d.bench.outputs) if o.group == "sensor"]
    felt = {k: apparent(d.bench.measured[k][:, cords]) for k in d.sealed_trials}
    felt = {k: e for k, e in felt.items() if np.isfinite(e).all(axis=1).sum() > 3}
    if not cords or not felt:
        return None
    trial = max(felt, key=lambda k: float(np.nanmax(np.nanstd(felt[k], axis=0))))
    shown = _most(felt[trial], d.bench.inputs[trial].command)
    if shown is None:
        return None
    tendon, columns = shown
    traces = _traces(d, trial, tendon, [cords[c] for c in columns])
    name = plain(labels(d, (trial,))[0])
    unit = d.bench.drives[tendon].shown[0]
    out = figure(traces, HEIGHT)
    out.update_xaxes(title_text=f"{plain(d.bench.drivers[tendon].name)} ({unit})")
    out.update_yaxes(title_text=f"apparent strain since the start of {name} (%)")
    return Plot(f"Strain loops of sealed trial {name}", HEIGHT, out)


def apparent(R: np.ndarray) -> np.ndarray:
    """(n, s) of resistances (n, s) ohm since their first readings."""
    known = np.isfinite(R)
    first = np.array([r[k][0] if k.any() else np.nan for r, k in zip(R.T, known.T, strict=True)])
    one = np.ones_like(first)
    return strain(R, Cords(first, one, one))


def _most(felt: np.ndarray, command: np.ndarray) -> tuple[int, list[int]] | None:
    """The cords that moved most, in order, and the tendon that went along with the first of them; None where no tendon moved."""
    if not np.ptp(command, axis=0).any():
        return None
    spread = np.nan_to_num(np.nanstd(felt, axis=0))
    known = np.isfinite(felt[:, spread.argmax()])
    y = felt[known, spread.argmax()]
    with np.errstate(invalid="ignore", divide="ignore"):
        together = np.abs([np.corrcoef(u[known], y)[0, 1] for u in command.T])
    return int(np.nan_to_num(together).argmax()), sorted(np.argsort(-spread)[: len(COLOURS)].tolist())


def _traces(d: Diagnosis, trial: int, tendon: int, columns: list[int]) -> list[go.Scatter]:
    x = d.bench.drives[tendon].shown[1] * d.bench.inputs[trial].command[:, tendon]
    measured = PERCENT * apparent(d.bench.measured[trial][:, columns])
    traces = []
    for stage in before_and_after(d):
        predicted = PERCENT * apparent(d.predictions[stage.key][trial][:, columns])
        for i, colour in enumerate(COLOURS[: len(columns)]):
            line = {"width": 2, "color": colour} if stage.color == ACCENT else {"width": 1.5, "color": BEFORE, "dash": "dot"}
            style = {"mode": "lines", "line": line, "name": stage.words, "showlegend": i == 0, "hoverinfo": "skip"}
            traces.append(go.Scatter(x=numbers(x), y=numbers(predicted[:, i]), **style))
    keep = thin(len(x), MOST_POINTS // len(columns))
    for i, (column, colour) in enumerate(zip(columns, COLOURS, strict=False)):
        name = d.bench.outputs[column].channel.name
        dots = {"size": 5, "color": colour, "opacity": 0.5}
        shown = f"{name}: %{{x:.2f}}, %{{y:.2f}} %<extra></extra>"
        y = numbers(measured[keep, i])
        traces.append(go.Scatter(x=numbers(x[keep]), y=y, mode="markers", marker=dots, name=name, hovertemplate=shown))
    return traces
