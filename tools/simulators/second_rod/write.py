"""One day as files: a measurement set by measurements.md, and beside it, elsewhere, the truth."""

import contextlib
import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tools.simulators.second_rod.day import Day, Trial, draw_day
from tools.simulators.second_rod.effects import EFFECT_KINDS, Effect
from tools.simulators.second_rod.mechanics.simulate import Run, simulate, without_effects
from tools.simulators.second_rod.mechanics.tendons import ROD_TENDONS
from tools.simulators.second_rod.plan import Planned
from tools.simulators.second_rod.robot import numbers
from tools.simulators.second_rod.sizing import Size, Sizer

Array = np.ndarray
TEMPERATURE_NOISE = 0.1  # K
FILE_UNITS = {"tension": ("N", 1.0), "displacement": ("mm", 1e3)}  # of the file, and how many of them to the SI unit


def make_day(out: Path, planned: Planned, seed: int, trials: int | None = None) -> str | None:
    """Writes sets/day_NN and truth/day_NN.json below `out`, whole or not at all; a line about it, None if it was there before."""
    name = f"day_{planned.number:02d}"
    final = out / "sets" / name
    if final.exists():
        return None
    random = np.random.default_rng([seed, planned.number])
    kinds = [EFFECT_KINDS[kind] for kind in planned.kinds]
    day = draw_day(random, planned.drive, frozenset().union(*(kind.wants for kind in kinds)), trials)
    sizer = Sizer(day)
    found = [sizer.drawn(kind, target, random) for kind, target in zip(kinds, planned.targets, strict=True)]
    effects = [effect for effect, _ in found]
    runs = simulate(day, effects)
    plain = without_effects(day, runs)
    whole = sizer.size(runs, plain) if effects else Size(0.0, 0.0, sum(run.failures for run in runs))

    unfinished = out / "unfinished" / name
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir(parents=True)
    write_set(unfinished, f"Bench day {planned.number:02d}", day, runs, planned.logs_others, random)
    (out / "truth").mkdir(exist_ok=True)
    final.parent.mkdir(exist_ok=True)
    text = json.dumps(truth(planned, seed, day, found, whole), indent=1) + "\n"
    draft = unfinished.with_suffix(".json")
    draft.write_text(text)
    # the truth first, the set last: a set that is there has its truth
    draft.rename(out / "truth" / f"{name}.json")
    unfinished.rename(final)
    with contextlib.suppress(OSError):  # another run's unfinished day may be there
        unfinished.parent.rmdir()
    rows = sum(run.inputs.shape[0] for run in runs)
    return f"{name}: {planned.drive}, {len(runs)} trials, {rows} rows, {whole.failures} equilibria not found"


def write_set(folder: Path, title: str, day: Day, runs: Sequence[Run], logs_others: bool, random: np.random.Generator) -> None:
    """The set's description and its trials, with noise."""
    other = "tension" if day.by_displacement else "displacement"
    noises = {"tension": day.tension_noise, "displacement": day.displacement_noise}
    text = [
        'format  = "twin-measurements/1"', 'robot   = "continuum"', f'title   = "{title}"',
        'source  = "simulation: second bench"', f"gravity = {vector(day.gravities[day.mount])}", "",
    ]  # fmt: skip

    def channel(name: str, role: str, unit: str, noise: float) -> None:
        text.extend(["[[channel]]", f'name = "{name}"', f'role = "{role}"', f'unit = "{unit}"'])
        text.extend([f"noise = {noise:.4g}"] if day.tells_noise else [])
        text.append("")

    for quantity, role in [(day.drive, "input")] + [(other, "output")] * logs_others:
        unit, scale = FILE_UNITS[quantity]
        for tendon in range(1, ROD_TENDONS + 1):
            channel(f"tendon_{tendon}_{quantity}", role, unit, noises[quantity] * scale)
    if day.logs_temperature:
        channel("ambient_temperature", "context", "degC", TEMPERATURE_NOISE)
    for disk in day.markers:
        for axis in "xyz":
            channel(f"disk_{disk}_{axis}", "output", "mm", day.marker_noise * 1e3)
    for trial, run in zip(day.trials, runs, strict=True):
        write_trial(folder / f"{trial.name}.csv", day, trial, run, other if logs_others else None, random)
        text += ["[[trial]]", f'file = "{trial.name}.csv"', f"start = {trial.start}", f'tip_payload = "{1e3 * trial.payload:g} g"']
        if trial.mount != day.mount:
            text.append(f"gravity = {vector(day.gravities[trial.mount])}")
        text.append("")
    (folder / "measurements.toml").write_text("\n".join(text))


def vector(values: Array) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def write_trial(path: Path, day: Day, trial: Trial, run: Run, other: str | None, random: np.random.Generator) -> None:
    """A table of one trial: noise added, some markers missing."""
    columns: dict[str, Array] = {"time": trial.times}

    def tendons(quantity: str, values: Array, noise: float) -> None:
        measured = values + random.normal(0, noise, values.shape)
        for tendon in range(ROD_TENDONS):
            columns[f"tendon_{tendon + 1}_{quantity}"] = measured[:, tendon] * FILE_UNITS[quantity][1]

    tendons(day.drive, run.inputs, day.input_noise)
    if other is not None:
        tendons(other, run.others, day.tension_noise if day.by_displacement else day.displacement_noise)
    if day.logs_temperature:
        warmth = day.temperature(trial.start + trial.times)
        columns["ambient_temperature"] = warmth + random.normal(0, TEMPERATURE_NOISE, warmth.shape)
    for disk in day.markers:
        seen = 1e3 * (run.positions[:, disk - 1] + random.normal(0, day.marker_noise, (trial.times.size, 3)))
        seen[random.random(trial.times.size) < day.missing] = np.nan
        for axis in range(3):
            columns[f"disk_{disk}_{'xyz'[axis]}"] = seen[:, axis]
    lines = [",".join(columns)]
    for row in np.column_stack(list(columns.values())):
        lines.append(",".join("" if np.isnan(value) else f"{value:.4f}" for value in row))
    path.write_text("\n".join(lines) + "\n")


def truth(planned: Planned, seed: int, day: Day, found: Sequence[tuple[Effect, Size]], whole: Size) -> dict[str, Any]:
    """What is wrong and how large it is, and the robot as built; sizes in marker noises a coordinate, SI units else."""
    effects = [
        {
            "id": effect.identifier,
            "kind": effect.name,
            "known": effect.known,
            "law": effect.law,
            "parameters": effect.parameters(),
            "size": {"asked": target, "after_refit": size.after_refit, "before_refit": size.raw},
        }
        for (effect, size), target in zip(found, planned.targets, strict=True)
    ]
    return {
        "day": planned.number,
        "seed": seed,
        "drive": day.drive,
        "effects": effects,
        "size": {"after_refit": whole.after_refit, "before_refit": whole.raw},
        "noise": {"marker": day.marker_noise, "tension": day.tension_noise, "displacement": day.displacement_noise},
        "robot": numbers(day.robot),
        "repeated_trials": day.repeats,
        "equilibria_not_found": whole.failures,
    }
