"""Currents heat the three springs in turn; the loop of tension against temperature, from a simulated recording.

python -m tools.examples.heated_springs
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from twin import Recording, Twin
from twin.measurements import Channel, Trial

UNITS = {"temperature": "degC", "tension": "N"}


def turns(seconds: float = 240.0) -> Recording:
    """A recording that has currents and asks for temperatures and tensions: 1.2 A for 20 s in each spring, 40 s of rest."""
    time = np.arange(0.0, seconds, 0.5)
    current = {f"sma_{i}_current": 1.2 * ((time % 180.0 >= 60.0 * (i - 1)) & (time % 60.0 < 20.0)) for i in (1, 2, 3)}
    asked = {f"{what}": np.zeros(len(time)) for i in (1, 2, 3) for what in (f"sma_{i}_temperature", f"tendon_{i}_tension")}
    channels = [Channel(name, "input", "A") for name in current]
    channels += [Channel(name, "output", UNITS[name.rpartition("_")[2]]) for name in asked]
    trial = Trial("turns.csv", time, {**current, **asked}, {})
    return Recording(
        "continuum", "springs in turn", "simulation: an example", np.array([0.0, 0.0, 9.81]), tuple(channels), (trial,)
    )


def figure(recording: Recording) -> go.Figure:
    values = recording.trials[0].values
    loops = [
        go.Scatter(x=values[f"sma_{i}_temperature"] - 273.15, y=values[f"tendon_{i}_tension"], name=f"spring {i}")
        for i in (1, 2, 3)
    ]
    return go.Figure(loops).update_layout(
        title=f"Tension against temperature ({recording.source})", xaxis_title="temperature, degC", yaxis_title="tension, N"
    )


def main(out: Path = Path("heat.html"), seconds: float = 240.0) -> None:
    figure(Twin.of("continuum").predict(turns(seconds))).write_html(out)


if __name__ == "__main__":
    main()
