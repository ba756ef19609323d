"""The noise every number rests on: per channel, of the tension readings, its correlation in time, and where it was found."""

from __future__ import annotations

import numpy as np

from twin.report.contents import KINDS
from twin.report.numbers import MM, column
from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    d = story.diagnosis
    groups = list(dict.fromkeys(o.group for o in d.bench.outputs))
    rows = []
    for g in groups:
        j = [i for i, o in enumerate(d.bench.outputs) if o.group == g]
        sigma = MM * d.noise.sigma[j]
        low, high = column([float(sigma.min()), float(sigma.max())])
        rows.append(
            {
                "kind": KINDS.get(g, g).replace("_", " "),
                "channels": len(j),
                "sigma": low if low == high else f"{low} to {high}",
                "rho": f"{float(np.mean(d.noise.rho[j])):.2f}",
                "floor": column([MM * d.errors.floor[g]])[0],
            }
        )
    content = {"rows": rows, "tension": f"{1e3 * d.noise.tension:.1f}", "origin": d.noise.source}
    return Section("noise", "The noise", "noise.html", content)
