"""The robot's own parameters after calibration, beside its description; and those the data do not fix."""

from __future__ import annotations

from twin.quantities import Fitted
from twin.report.numbers import digits, friendly, number
from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    d = story.diagnosis
    declared = {p.name: p for p in d.bench.robot.parameters}
    rows = []
    for name, fitted in d.parameters.items():
        shown = friendly(fitted)
        places = digits(shown.value, shown.std)
        p = declared.get(name)
        before = None if p is None else friendly(Fitted(p.value, p.std, p.unit))
        rows.append(
            {
                "name": name,
                "unit": shown.unit or "1",
                "value": number(shown.value, places),
                "std": number(shown.std, places),
                "nominal": "–" if before is None else number(before.value, places),
                "belief": "–" if before is None else number(before.std, places),
                "unfixed": name in d.unfixed,
            }
        )
    known = set(d.parameters)
    return Section("parameters", "The calibrated robot", "parameters.html", {"rows": rows, "others": [n for n in d.unfixed if n not in known]})
