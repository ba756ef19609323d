"""The calibrated parameters of the robot and of its declared effects beside their description, and those not determined."""

from twin.report.numbers import NO_NUMBER, decimals_for_error, everyday_unit, format_number, in_everyday_unit
from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    """Return the section on the calibrated parameters."""
    d = story.diagnosis
    robot = d.prepared.robot
    declared = {p.name: p for p in robot.parameters} | {f"{e}.{p.name}": p for e, p in robot.uncertain}
    shown = {name: in_everyday_unit(fitted) for name, fitted in d.parameters.items()}
    decimals: dict[str, int] = {}
    for name, f in shown.items():
        decimals[_list_name(name)] = max(decimals.get(_list_name(name), 0), decimals_for_error(f.value, f.std))
    rows = []
    for name, f in shown.items():
        places, p = decimals[_list_name(name)], declared.get(name)
        factor = everyday_unit(d.parameters[name].unit, d.parameters[name].value)[1]
        rows.append(
            {
                "name": name,
                "unit": f.unit or "1",
                "value": format_number(f.value, places),
                "std": format_number(f.std, places),
                "nominal": NO_NUMBER if p is None else format_number(p.value * factor, places),
                "belief": NO_NUMBER if p is None or p.std is None else format_number(p.std * factor, places),
                "unfixed": name in d.unfixed,
            }
        )
    others = [name for name in d.unfixed if name not in d.parameters]
    return Section("parameters", "Calibrated parameters", "data/parameters.html", {"rows": rows, "others": others})


def _list_name(name: str) -> str:
    """Return the name of the list that a parameter belongs to: "disks.pitch_3" -> "disks.pitch"."""
    return name.rstrip("0123456789").rstrip("_")
