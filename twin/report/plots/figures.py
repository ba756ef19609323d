"""The style of the figures: light axes, one accent colour, a bounded number of points."""

import html
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

ACCENT_COLOUR = "#0f6b74"
MEASURED_COLOUR = "#1c2329"
BEFORE_COLOUR = "#9aa3aa"
GRID_COLOUR = "#e6e9eb"
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
MOST_POINTS = 4000  # a figure


@dataclass(frozen=True)
class Plot:
    """A figure on the page: a description for screen readers, the height in pixels and the content."""

    description: str
    height: int
    figure: go.Figure

    @property
    def json(self) -> Markup:
        """Return the figure as JSON that cannot end the script element around it."""
        spec = json.loads(str(self.figure.to_json()))
        text = json.dumps({"data": spec["data"], "layout": spec["layout"]}, separators=(",", ":"))
        return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def escape_markup(text: str) -> str:
    """Escape text of the data, such as names of trials; plotly would read tags in it."""
    return html.escape(text, quote=False)


def thinned_indices(count: int, most: int) -> np.ndarray:
    """Return at most `most` indices (m,), evenly spread over `count` points, with the first and the last."""
    return np.arange(count) if count <= most else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def single_precision(values: Any) -> np.ndarray:
    """Return values in single precision, which is enough to plot."""
    return np.asarray(values, np.float32)


def styled_figure(traces: list[Any], height: int, **layout: Any) -> go.Figure:
    """Make a figure of traces in the common style."""
    style: dict[str, Any] = {
        "height": height,
        "margin": {"l": 58, "r": 14, "t": 34, "b": 48},
        "font": {"family": FONT, "size": 13, "color": MEASURED_COLOUR},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "hovermode": "closest",
        "legend": {"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom", "font": {"size": 13}},
    }
    out = go.Figure(traces, layout={**style, **layout})
    line = "#c3c9cd"
    quiet: dict[str, Any] = {
        "gridcolor": GRID_COLOUR,
        "zerolinecolor": line,
        "linecolor": line,
        "ticks": "outside",
        "tickcolor": line,
    }
    quiet["title"] = {"font": {"size": 13}, "standoff": 8}
    out.update_xaxes(quiet)
    out.update_yaxes(quiet)
    out.layout.template = None  # type: ignore[attr-defined]
    return out


def equal_axes(points: np.ndarray) -> dict[str, object]:
    """Return axes of equal scale around points (n, 3) mm, none shorter than a third of the longest."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(1.1 * (high - low), 0.33 * (high - low).max() + 1e-9)
    middle = 0.5 * (low + high)
    axis = {"backgroundcolor": "rgba(0,0,0,0)", "gridcolor": "#dfe3e6", "showspikes": False, "nticks": 7}
    axes = {
        f"{a}axis": {"title": {"text": f"{a} (mm)"}, "range": [float(m - s / 2), float(m + s / 2)], **axis}
        for a, m, s in zip("xyz", middle, span, strict=True)
    }
    ratio = dict(zip("xyz", map(float, 1.25 * span / span.max()), strict=True))
    return {**axes, "aspectmode": "manual", "aspectratio": ratio, "dragmode": "orbit"}
