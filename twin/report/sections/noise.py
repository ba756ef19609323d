"""The noise every number rests on: per channel, of the tension readings, its correlation in time, and where it was found."""

from __future__ import annotations

import numpy as np

from twin.evaluate import KIND
from twin.report.numbers import SHOWN, column
from twin.report.sections.section import Section, Story
from twin.report.sentence import groups
from twin.wording import in_words


def section(story: Story) -> Section:
    d = story.diagnosis
    rows = []
    for g in groups(d):
        j = [i for i, o in enumerate(d.bench.outputs) if o.group == g]
        sigma = SHOWN[g][1] * d.noise.sigma[j]
        low, high = column([float(sigma.min()), float(sigma.max())])
        rows.append(
            {
                "kind": in_words(KIND[g]),
                "channels": len(j),
                "unit": SHOWN[g][0],
                "sigma": low if low == high else f"{low} to {high}",
                "rho": f"{float(np.mean(d.noise.rho[j])):.2f}",
                "floor": column([SHOWN[g][1] * d.errors.floor[g]])[0],
            }
        )
    inputs = [f"{SHOWN[of][1] * s:.3g} {SHOWN[of][0]}" for s, of in zip(d.noise.drive, d.bench.drives, strict=True)]
    content = {"rows": rows, "inputs": ", ".join(inputs), "origin": d.noise.source}
    return Section("noise", "The noise", "noise.html", content)
