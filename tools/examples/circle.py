"""The tip follows a circle with 20 g that nobody declared, by load cells and tendon displacements; wanted and true path.

python -m tools.examples.circle circle.html
"""

from __future__ import annotations

import sys
from pathlib import Path

import plotly.graph_objects as go

from tools.tracking import LAP, LENGTH, RADIUS, Bench, Run, controller, track, unknown
from twin.control.paths import paths


def figure(run: Run) -> go.Figure:
    on = run.time >= 0.0
    lines = [
        go.Scatter(x=1e3 * tip[on, 0], y=1e3 * tip[on, 1], name=name) for name, tip in (("wanted", run.wanted), ("true", run.tip))
    ]
    return go.Figure(lines).update_layout(
        title=f"Circle with an undeclared load, simulated: {1e3 * run.rms:.2f} mm RMS",
        xaxis_title="x, mm", yaxis={"title": "y, mm", "scaleanchor": "x"},
    )  # fmt: skip


def main(out: Path, until: float = LAP) -> None:
    run = track(Bench(unknown(), payload=0.02), controller("full"), paths(LENGTH, RADIUS)["circle"], until=until)
    figure(run).write_html(out)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
