"""The description: a length or a modulus of robot.toml that is off by a thousand."""

import re
from collections.abc import Iterator
from dataclasses import replace

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.thresholds import LEFT_BY_FILE_CHANGE


def parameters(case: Case) -> Iterator[Suspicion]:
    """Where nothing moves as described: each parameter a thousand times larger, and smaller."""
    columns, few = case.columns(case.group), case.few()
    before = case.error(columns, case.as_is(), few)
    if before < LEFT_BY_FILE_CHANGE * case.motion(columns):
        return
    found = []
    rows: dict[str, list] = {}
    for p in case.twin.robot.parameters:
        if p.value and p.unit != "1" and not p.name.startswith(("springs.", "damping.", "frame.")):
            rows.setdefault(re.sub(r"_\d+$", "", p.name), []).append(p)
    for name, group in rows.items():
        for factor in (1e-3, 1e3):
            twin = replace(case.twin, values={**case.twin.values, **{p.name: factor * p.value for p in group}})
            left = case.better(before, case.error(columns, case.again(lambda i: i, twin), few), columns)
            if left is not None:
                found.append((left, name, factor))
    if found:
        left, name, factor = min(found)
        words = f"the robot as described would not move as measured, and would with {name} {factor:g} times as large"
        yield Suspicion("description", words, f"the unit of {name} in robot.toml", left, case.group)
