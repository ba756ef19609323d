"""The robot's own parameters, and those of effects it is known to have, after calibration, beside their description; and those the
data do not fix."""

from __future__ import annotations

from twin.report.numbers import NONE, digits, everyday, friendly, number
from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    d = story.diagnosis
    robot = d.bench.robot
    declared = {p.name: p for p in robot.parameters} | {f"{e}.{p.name}": p for e, p in robot.uncertain}
    shown = {name: friendly(fitted) for name, fitted in d.parameters.items()}
    decimals: dict[str, int] = {}
    for name, f in shown.items():
        decimals[_family(name)] = max(decimals.get(_family(name), 0), digits(f.value, f.std))
    rows = []
    for name, f in shown.items():
        places, p = decimals[_family(name)], declared.get(name)
        factor = everyday(d.parameters[name].unit, d.parameters[name].value)[1]
        rows.append(
            {
                "name": name,
                "unit": f.unit or "1",
                "value": number(f.value, places),
                "std": number(f.std, places),
                "nominal": NONE if p is None else number(p.value * factor, places),
                "belief": NONE if p is None or p.std is None else number(p.std * factor, places),
                "unfixed": name in d.unfixed,
            }
        )
    others = [name for name in d.unfixed if name not in d.parameters]
    return Section("parameters", "The calibrated robot", "parameters.html", {"rows": rows, "others": others})


def _family(name: str) -> str:
    """What many parameters of one list share: "disks.pitch_3" -> "disks.pitch"."""
    return name.rstrip("0123456789").rstrip("_")
