"""The error on held-out trials: as described, calibrated, with the effects; and the noise floor."""

import plotly.graph_objects as go

from twin.diagnosis import Diagnosis
from twin.foundation.display_names import display_name
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.report.numbers import DISPLAY_UNITS, capitalised, decimals_for_digits, format_number
from twin.report.plots.figures import ACCENT_COLOUR, BEFORE_COLOUR, MEASURED_COLOUR, Plot, styled_figure
from twin.report.sections.section import Section, Story
from twin.report.sentence import describe_errors, output_groups, trial_labels

STAGE_LABELS = {"nominal": "as described", "calibrated": "calibrated", "after": "with the effects"}
CUT_BAR_RATIO = 5.0  # times the other errors: a longer nominal bar is cut off, or the others could not be seen
CUT_AXIS_RATIO = 1.5  # times the other errors: the range of a cut axis


def section(story: Story) -> Section:
    """Return the section on the error before and after."""
    d = story.diagnosis
    tables = [
        {
            "kind": capitalised(display_name(OUTPUT_GROUPS[g].kind)),
            "unit": DISPLAY_UNITS[g][0],
            "rows": error_rows(d, g),
            "twin": STAGE_LABELS[differing_stages(d)[-1]],
            "plot": plot(d, g),
        }
        for g in output_groups(d)
    ]
    content = {"tables": tables, "trials": trial_labels(d, d.held_out_trials), "words": describe_errors(d), "each": bool(d.folds)}
    return Section("before-after", "Error before and after", "answer/before_after.html", content)


def error_rows(d: Diagnosis, group: str) -> list[dict[str, str]]:
    """Return the rows of the table: stage, error, 95 % interval, in display units with equal decimals; the noise floor last."""
    floor = DISPLAY_UNITS[group][1] * d.errors.floor[group]
    decimals = decimals_for_digits([floor], 3)
    out = []
    for stage in differing_stages(d):
        value, interval = _error_and_interval(d, stage, group)
        ends = "" if interval is None else " to ".join(format_number(x, decimals) for x in interval)
        out.append({"stage": STAGE_LABELS[stage], "error": format_number(value, decimals), "interval": ends})
    if (value := d.errors.without_physics.get(group)) is not None:
        plain = format_number(DISPLAY_UNITS[group][1] * value, decimals)
        out.append({"stage": "polynomial, no physics", "error": plain, "interval": ""})
    return [*out, {"stage": "noise floor", "error": format_number(floor, decimals), "interval": ""}]


def differing_stages(d: Diagnosis) -> tuple[str, ...]:
    """Return the stages that differ; without effects the last twin is the calibrated one."""
    return ("nominal", "calibrated", "after") if d.claims else ("nominal", "calibrated")


def _error_and_interval(d: Diagnosis, stage: str, group: str) -> tuple[float, tuple[float, float] | None]:
    """Return error and interval of a stage in display units; the nominal stage has no interval."""
    e = d.errors
    value = {"nominal": e.nominal, "calibrated": e.calibrated, "after": e.after}[stage][group]
    interval = {"calibrated": e.ci_calibrated, "after": e.ci_after}.get(stage, {}).get(group)
    factor = DISPLAY_UNITS[group][1]
    return factor * value, None if interval is None else (factor * interval[0], factor * interval[1])


def plot(d: Diagnosis, group: str) -> Plot:
    """Plot the errors of one group of outputs as bars; a nominal bar beyond `CUT_BAR_RATIO` is cut and labelled."""
    shown, (unit, factor) = differing_stages(d), DISPLAY_UNITS[group]
    found = [_error_and_interval(d, s, group) for s in shown]
    ends = [interval or (value, value) for value, interval in found]
    values = [value for value, _ in found]
    spread = {
        "type": "data",
        "array": [high - value for (_, high), value in zip(ends, values, strict=True)],
        "arrayminus": [value - low for (low, _), value in zip(ends, values, strict=True)],
        "color": MEASURED_COLOUR,
        "thickness": 1.3,
        "width": 5,
    }
    limits = go.Bar(
        x=values,
        y=[STAGE_LABELS[s] for s in shown],
        orientation="h",
        width=0.5,
        marker={"color": [BEFORE_COLOUR] * (len(shown) - 1) + [ACCENT_COLOUR]},
        error_x=spread,
        hovertemplate=f"%{{y}}: %{{x:.3f}} {unit}<extra></extra>",
    )
    height = 100 + 44 * len(shown)
    out = styled_figure([limits], height, showlegend=False, margin={"l": 120, "r": 14, "t": 28, "b": 50})
    out.update_yaxes(autorange="reversed", ticks="", showgrid=False)
    out.update_xaxes(title_text=f"root-mean-square error ({unit})", rangemode="tozero")
    floor = factor * d.errors.floor[group]
    others = max([floor, *(high for _, high in ends[1:])])
    if values[0] > CUT_BAR_RATIO * others:
        out.update_xaxes(range=[0.0, CUT_AXIS_RATIO * others])
        text = f"{format_number(values[0], decimals_for_digits(values[:1], 3))} {unit} \N{RIGHTWARDS ARROW}"
        out.add_annotation(
            x=0.99, xref="paper", xanchor="right", y=STAGE_LABELS[shown[0]], text=text, showarrow=False, font={"size": 12}
        )
    out.add_vline(x=floor, line={"color": MEASURED_COLOUR, "width": 1.2, "dash": "dot"})
    out.add_annotation(x=floor, y=1, yref="paper", yanchor="bottom", text="noise floor", showarrow=False, font={"size": 12})
    return Plot("Error before and after, with the noise floor", height, out)
