"""The house style of the figures: quiet axes, one accent colour, a bounded number of points."""

from __future__ import annotations

import html
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

ACCENT = "#0f6b74"
MEASURED = "#1c2329"
BEFORE = "#9aa3aa"
GRID = "#e6e9eb"
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
MOST_POINTS = 4000  # a figure


@dataclass(frozen=True)
class Plot:
    """A figure on the page: what it is called for those who cannot see it, its height in pixels and its content."""

    words: str
    height: int
    figure: go.Figure

    @property
    def json(self) -> Markup:
        """The figure as JSON that cannot end the script element it stands in."""
        spec = json.loads(str(self.figure.to_json()))
        text = json.dumps({"data": spec["data"], "layout": spec["layout"]}, separators=(",", ":"))
        return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def plain(text: str) -> str:
    """Text of the data (names of trials) as plotly shows it literally: plotly reads tags in its labels."""
    return html.escape(text, quote=False)


def thin(count: int, most: int) -> np.ndarray:
    """At most `most` indices (m,) evenly spread over `count` points, the first and the last among them."""
    return np.arange(count) if count <= most else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def numbers(values: Any) -> np.ndarray:
    """Values to plot, in single precision."""
    return np.asarray(values, np.float32)


def figure(traces: list[Any], height: int, **layout: Any) -> go.Figure:
    """Traces in the house style."""
    style: dict[str, Any] = {
        "height": height,
        "margin": {"l": 58, "r": 14, "t": 34, "b": 48},
        "font": {"family": FONT, "size": 13, "color": MEASURED},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "hovermode": "closest",
        "legend": {"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom", "font": {"size": 13}},
    }
    out = go.Figure(traces, layout={**style, **layout})
    line = "#c3c9cd"
    quiet: dict[str, Any] = {"gridcolor": GRID, "zerolinecolor": line, "linecolor": line, "ticks": "outside", "tickcolor": line}
    quiet["title"] = {"font": {"size": 13}, "standoff": 8}
    out.update_xaxes(quiet)
    out.update_yaxes(quiet)
    out.layout.template = None  # type: ignore[attr-defined]
    return out


def box(points: np.ndarray) -> dict[str, object]:
    """Axes of equal scale around points (n, 3) mm, none shorter than a third of the longest."""
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
