"""The error on sealed trials: as described, calibrated, with the effects; and the noise floor."""

from __future__ import annotations

import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.evaluate import KIND
from twin.report.numbers import SHOWN, number, places, upper_first
from twin.report.plots import ACCENT, BEFORE, MEASURED, Plot, figure
from twin.report.sections.section import Section, Story
from twin.report.sentence import error_words, groups, labels
from twin.wording import in_words

ROWS = {"nominal": "as described", "calibrated": "calibrated", "after": "with the effects"}
FAR = 5.0  # times all else: a description that is further off would leave nothing to see of the others, and its bar is cut off
ROOM = 1.5  # times all else that a cut axis shows


def section(story: Story) -> Section:
    d = story.diagnosis
    tables = [
        {"kind": upper_first(in_words(KIND[g])), "unit": SHOWN[g][0], "rows": rows(d, g), "plot": plot(d, g)} for g in groups(d)
    ]
    content = {"tables": tables, "trials": labels(d, d.sealed_trials), "words": error_words(d)}
    return Section("before-after", "Before and after", "before_after.html", content)


def rows(d: Diagnosis, group: str) -> list[dict[str, str]]:
    """The table: stage, error, 95 % interval, all in the unit people read with the same decimals; the noise floor last."""
    floor = SHOWN[group][1] * d.errors.floor[group]
    decimals = places([floor], 3)
    out = []
    for stage in stages(d):
        value, interval = _of(d, stage, group)
        ends = "" if interval is None else " to ".join(number(x, decimals) for x in interval)
        out.append({"stage": ROWS[stage], "error": number(value, decimals), "interval": ends})
    return [*out, {"stage": "noise floor", "error": number(floor, decimals), "interval": ""}]


def stages(d: Diagnosis) -> tuple[str, ...]:
    """The stages that differ: without effects, what comes after is the calibrated twin itself."""
    return ("nominal", "calibrated", "after") if d.claims else ("nominal", "calibrated")


def _of(d: Diagnosis, stage: str, group: str) -> tuple[float, tuple[float, float] | None]:
    """Error and its interval, in the unit people read, at a stage; nominal has none."""
    e = d.errors
    value = {"nominal": e.nominal, "calibrated": e.calibrated, "after": e.after}[stage][group]
    interval = {"calibrated": e.ci_calibrated, "after": e.ci_after}.get(stage, {}).get(group)
    factor = SHOWN[group][1]
    return factor * value, None if interval is None else (factor * interval[0], factor * interval[1])


def plot(d: Diagnosis, group: str) -> Plot:
    """The errors of one group of outputs as bars; that of a description `FAR` off is cut and its number written in it."""
    shown, (unit, factor) = stages(d), SHOWN[group]
    found = [_of(d, s, group) for s in shown]
    ends = [interval or (value, value) for value, interval in found]
    values = [value for value, _ in found]
    spread = {
        "type": "data",
        "array": [high - value for (_, high), value in zip(ends, values, strict=True)],
        "arrayminus": [value - low for (low, _), value in zip(ends, values, strict=True)],
        "color": MEASURED,
        "thickness": 1.3,
        "width": 5,
    }
    bars = go.Bar(
        x=values,
        y=[ROWS[s] for s in shown],
        orientation="h",
        width=0.5,
        marker={"color": [BEFORE] * (len(shown) - 1) + [ACCENT]},
        error_x=spread,
        hovertemplate=f"%{{y}}: %{{x:.3f}} {unit}<extra></extra>",
    )
    height = 100 + 44 * len(shown)
    out = figure([bars], height, showlegend=False, margin={"l": 120, "r": 14, "t": 28, "b": 50})
    out.update_yaxes(autorange="reversed", ticks="", showgrid=False)
    out.update_xaxes(title_text=f"root-mean-square error ({unit})", rangemode="tozero")
    floor = factor * d.errors.floor[group]
    others = max([floor, *(high for _, high in ends[1:])])
    if values[0] > FAR * others:
        out.update_xaxes(range=[0.0, ROOM * others])
        text = f"{number(values[0], places(values[:1], 3))} {unit} \N{RIGHTWARDS ARROW}"
        out.add_annotation(x=0.99, xref="paper", xanchor="right", y=ROWS[shown[0]], text=text, showarrow=False, font={"size": 12})
    out.add_vline(x=floor, line={"color": MEASURED, "width": 1.2, "dash": "dot"})
    out.add_annotation(x=floor, y=1, yref="paper", yanchor="bottom", text="noise floor", showarrow=False, font={"size": 12})
    return Plot("Error before and after, with the noise floor", height, out)
