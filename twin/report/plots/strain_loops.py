"""Plot strain loops: strains of the cords in a held-out trial, measured and predicted, against the pull of a tendon."""

import numpy as np
import plotly.graph_objects as go

from twin.body.strain_cords import Cords, strain
from twin.diagnosis import Diagnosis
from twin.report.numbers import PERCENT
from twin.report.plots.figures import (
    ACCENT_COLOUR,
    BEFORE_COLOUR,
    MOST_POINTS,
    Plot,
    escape_markup,
    single_precision,
    styled_figure,
    thinned_indices,
)
from twin.report.plots.predictions import compared_stages
from twin.report.sentence import trial_labels

CORD_COLOURS = ("#0f6b74", "#b9893a", "#7a4a8c", "#5a7d2a")  # of the cords that moved most
STRAIN_LOOPS_HEIGHT = 420


def plot(d: Diagnosis) -> Plot | None:
    """Plot apparent strains kappa eps = sqrt(R / R0) - 1 against the tendon that moves them most; R0 is the first reading.

    The trial is the held-out one in which the strains move most. Dots are measured, lines predicted. None without measured cords.
    """
    cords = [j for j, o in enumerate(d.prepared.outputs) if o.group == "sensor"]
    strains = {k: apparent_strain(d.prepared.measured[k][:, cords]) for k in d.held_out_trials}
    strains = {k: e for k, e in strains.items() if np.isfinite(e).all(axis=1).sum() > 3}
    if not cords or not strains:
        return None
    trial = max(strains, key=lambda k: float(np.nanmax(np.nanstd(strains[k], axis=0))))
    shown = _most_strained(strains[trial], d.prepared.inputs[trial].command)
    if shown is None:
        return None
    tendon, columns = shown
    traces = _traces(d, trial, tendon, [cords[c] for c in columns])
    name = escape_markup(trial_labels(d, (trial,))[0])
    unit = d.prepared.drives[tendon].display_unit[0]
    out = styled_figure(traces, STRAIN_LOOPS_HEIGHT)
    out.update_xaxes(title_text=f"{escape_markup(d.prepared.drivers[tendon].name)} ({unit})")
    out.update_yaxes(title_text=f"apparent strain since the start of {name} (%)")
    return Plot(f"Strain loops of held-out trial {name}", STRAIN_LOOPS_HEIGHT, out)


def apparent_strain(R: np.ndarray) -> np.ndarray:
    """Return the apparent strains (n, s) of resistances (n, s) ohm since their first readings."""
    known = np.isfinite(R)
    first = np.array([r[k][0] if k.any() else np.nan for r, k in zip(R.T, known.T, strict=True)])
    one = np.ones_like(first)
    return strain(R, Cords(first, one, one))


def _most_strained(strains: np.ndarray, command: np.ndarray) -> tuple[int, list[int]] | None:
    """Return the tendon most correlated with the most strained cord, and the most strained cords; None if no tendon moved."""
    if not np.ptp(command, axis=0).any():
        return None
    spread = np.nan_to_num(np.nanstd(strains, axis=0))
    known = np.isfinite(strains[:, spread.argmax()])
    y = strains[known, spread.argmax()]
    with np.errstate(invalid="ignore", divide="ignore"):
        together = np.abs([np.corrcoef(u[known], y)[0, 1] for u in command.T])
    return int(np.nan_to_num(together).argmax()), sorted(np.argsort(-spread)[: len(CORD_COLOURS)].tolist())


def _traces(d: Diagnosis, trial: int, tendon: int, columns: list[int]) -> list[go.Scatter]:
    x = d.prepared.drives[tendon].display_unit[1] * d.prepared.inputs[trial].command[:, tendon]
    measured = PERCENT * apparent_strain(d.prepared.measured[trial][:, columns])
    traces = []
    for stage in compared_stages(d):
        predicted = PERCENT * apparent_strain(d.predictions[stage.key][trial][:, columns])
        for i, colour in enumerate(CORD_COLOURS[: len(columns)]):
            line = (
                {"width": 2, "color": colour}
                if stage.colour == ACCENT_COLOUR
                else {"width": 1.5, "color": BEFORE_COLOUR, "dash": "dot"}
            )
            style = {"mode": "lines", "line": line, "name": stage.label, "showlegend": i == 0, "hoverinfo": "skip"}
            traces.append(go.Scatter(x=single_precision(x), y=single_precision(predicted[:, i]), **style))
    keep = thinned_indices(len(x), MOST_POINTS // len(columns))
    for i, (column, colour) in enumerate(zip(columns, CORD_COLOURS, strict=False)):
        name = d.prepared.outputs[column].channel.name
        dots = {"size": 5, "color": colour, "opacity": 0.5}
        shown = f"{name}: %{{x:.2f}}, %{{y:.2f}} %<extra></extra>"
        y = single_precision(measured[keep, i])
        traces.append(go.Scatter(x=single_precision(x[keep]), y=y, mode="markers", marker=dots, name=name, hovertemplate=shown))
    return traces
