"""The noise: of each kind of output and of the input readings, its correlation in time, and its origin."""

import numpy as np

from twin.foundation.display_names import display_name
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.report.numbers import DISPLAY_UNITS, format_column
from twin.report.sections.section import Section, Story
from twin.report.sentence import output_groups


def section(story: Story) -> Section:
    """Return the section on the noise."""
    d = story.diagnosis
    rows = []
    for g in output_groups(d):
        j = [i for i, o in enumerate(d.prepared.outputs) if o.group == g]
        sigma = DISPLAY_UNITS[g][1] * d.noise.sigma[j]
        low, high = format_column([float(sigma.min()), float(sigma.max())])
        rows.append(
            {
                "kind": display_name(OUTPUT_GROUPS[g].kind),
                "channels": len(j),
                "unit": DISPLAY_UNITS[g][0],
                "sigma": low if low == high else f"{low} to {high}",
                "rho": f"{float(np.mean(d.noise.rho[j])):.2f}",
                "floor": format_column([DISPLAY_UNITS[g][1] * d.errors.floor[g]])[0],
            }
        )
    inputs = [
        f"{DISPLAY_UNITS[of][1] * s:.3g} {DISPLAY_UNITS[of][0]}" for s, of in zip(d.noise.drive, d.prepared.drives, strict=True)
    ]
    content = {"rows": rows, "inputs": ", ".join(inputs), "origin": d.noise.source}
    return Section("noise", "Noise", "data/noise.html", content)
