"""Makes a measurement set from a seed: measured/, holdout/ and truth.json; the same arguments give the same bytes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tyro.conf import UseAppendAction, arg

from tools.simulators.articulated.amplitude import Scale, scaled
from tools.simulators.articulated.bench import DECIMALS, Channel, Trial, channels, command_unit, observe
from tools.simulators.articulated.describe import write_robot
from tools.simulators.articulated.drives import all_effects
from tools.simulators.articulated.effects import Columns, Effect
from tools.simulators.articulated.robots import ROBOTS, Robot, built, delivered
from tools.simulators.articulated.trials import Day, session


@dataclass(frozen=True)
class Recipe:
    """What a measurement set is made of; the same recipe gives the same bytes."""

    robot: str = "tendon_finger"  # of ROBOTS
    effects: Annotated[UseAppendAction[tuple[str, ...]], arg(name="effect")] = ()  # may be repeated; none: a clean day
    level: float = 3.0  # sigmas that each effect leaves by itself
    seed: int = 0

    def __post_init__(self) -> None:
        """Raise ValueError for a name that is not known or an effect that the robot cannot have."""
        if self.robot not in ROBOTS:
            raise ValueError(f"{self.robot}: not one of {', '.join(ROBOTS)}")
        fitting = [name for name, effect in all_effects().items() if effect.fits(ROBOTS[self.robot]())]
        if other := [name for name in self.effects if name not in fitting]:
            raise ValueError(f"{', '.join(other)}: {self.robot} may have {', '.join(fitting)}")


@dataclass(frozen=True)
class Written:
    """A folder's readings and, beside them, what perfect instruments would have shown."""

    readings: list[Columns]
    exact: list[Columns]


def make_set(folder: Path, recipe: Recipe) -> dict[str, Any]:
    """Write the set and return its truth."""
    described = ROBOTS[recipe.robot]()
    # Streams of their own, so that adding an effect changes neither robot nor day.
    parts, motions, instruments, laws = (np.random.default_rng([recipe.seed, n]) for n in range(4))
    deviations = delivered(described, parts)
    day = session(described, motions, camera=True if "camera_misalignment" in recipe.effects else None)
    drawn = [all_effects()[name].draw(described, laws) for name in recipe.effects]
    found, total, raw = [], 0.0, 0.0
    if drawn:
        scale = Scale(described, deviations, day)
        found = [scaled(effect, recipe.level, scale) for effect in drawn]
        raw, total = scale.levels([effect for effect, _ in found])
    robot, effects = built(described, deviations), [effect for effect, _ in found]
    listed = channels(described, day.camera)
    written = {}
    for part, trials in (("measured", day.measured), ("holdout", day.holdout)):
        exact = [observe(robot, effects, trial) for trial in trials]
        written[part] = Written([read(described, listed, log, instruments) for log in exact], exact)
        write_robot(folder / part / "robot", described)
        title = f"{described.name} bench {recipe.seed}"
        (folder / part / "measurements.toml").write_text(measurements_toml(described, listed, trials, title))
        for trial, log in zip(trials, written[part].readings, strict=True):
            (folder / part / f"{trial.name}.csv").write_text(csv_text(described, listed, trial, log))
    made = {"robot": recipe.robot, "seed": recipe.seed} | _summary(found, recipe.level, total, raw)
    truth = made | _floors(listed, written["holdout"]) | _bench(described, robot, listed, day)
    (folder / "truth.json").write_text(json.dumps(truth, indent=1, default=_plain) + "\n")
    return truth


def read(robot: Robot, listed: Sequence[Channel], log: Columns, rng: np.random.Generator) -> Columns:
    """Return what the instruments show: noise added, then rounded to their steps."""
    shown = {}
    for channel in listed:
        instrument = robot.instruments[channel.instrument]
        noisy = log[channel.name] + instrument.sigma * rng.normal(size=len(log[channel.name]))
        shown[channel.name] = instrument.step * np.round(noisy / instrument.step)
    return shown


def measurements_toml(robot: Robot, listed: Sequence[Channel], trials: Sequence[Trial], title: str) -> str:
    """Return the text of measurements.toml."""
    lines = ['format = "twin-measurements/1"', 'robot = "./robot"', f'title = "{title}"', 'source = "hardware: bench"']
    for drive in robot.drives:
        lines += ["", "[[channel]]", f'name = "{drive.target}_command"', f'quantity = "actuator.{drive.name}.ctrl"']
        lines += ['role = "input"', f'unit = "{command_unit(drive)[0]}"']
    for channel in listed:
        instrument = robot.instruments[channel.instrument]
        lines += ["", "[[channel]]", f'name = "{channel.name}"', f'quantity = "{channel.quantity}"', 'role = "output"']
        lines += [f'unit = "{instrument.unit}"', f"noise = {instrument.sigma:g}"]
    for trial in trials:
        lines += ["", "[[trial]]", f'file = "{trial.name}.csv"', f"start = {trial.start:.2f}"]
        if trial.payload > 0.0:
            lines.append(f'payload = {{ {robot.tip} = "{1e3 * trial.payload:g} g" }}')
    return "\n".join(lines) + "\n"


def csv_text(robot: Robot, listed: Sequence[Channel], trial: Trial, log: Columns) -> str:
    """Return a trial's CSV: time, commands, outputs."""
    header = ["time", *(f"{d.target}_command" for d in robot.drives), *(c.name for c in listed)]
    cells = [[f"{t:.3f}" for t in trial.time]]
    for i, drive in enumerate(robot.drives):
        cells.append([f"{v:.{DECIMALS}f}" for v in trial.command[:, i] * command_unit(drive)[1]])
    cells += [[f"{v:.3f}" for v in log[c.name]] for c in listed]
    return "\n".join(",".join(row) for row in [header, *zip(*cells, strict=True)]) + "\n"


def _summary(found: Sequence[tuple[Effect, float]], asked: float, total: float, raw: float) -> dict[str, Any]:
    kinds = ("none", "single", "pair")
    return {
        "kind": kinds[len(found)] if len(found) < len(kinds) else "several",
        "truth": [effect.id for effect, _ in found],
        "in_catalogue": {effect.id: effect.in_catalogue for effect, _ in found},
        "parameters": {effect.id: asdict(effect) for effect, _ in found},
        "level": total,
        "level_asked": [asked] * len(found),
        "level_alone": {effect.id: level for effect, level in found},
        "raw_rms": raw,
    }


def _floors(listed: Sequence[Channel], holdout: Written) -> dict[str, Any]:
    """Return the RMS of noise and rounding on the held-out trials, by channel and by kind (per point for positions)."""
    by_channel = {}
    for c in listed:
        errors = [shown[c.name] - exact[c.name] for shown, exact in zip(holdout.readings, holdout.exact, strict=True)]
        by_channel[c.name] = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    floor = {}
    for kind in dict.fromkeys(c.kind for c in listed):
        squares = [by_channel[c.name] ** 2 for c in listed if c.kind == kind]
        point = any(c.kind == kind and c.instrument == "tip" for c in listed)
        floor[kind] = float(np.sqrt(np.sum(squares) if point else np.mean(squares)))
    return {"floor": floor, "floor_by_channel": by_channel}


def _bench(described: Robot, robot: Robot, listed: Sequence[Channel], day: Day) -> dict[str, Any]:
    units = {c.name: described.instruments[c.instrument] for c in listed}
    groups = {"links": robot.links, "joints": robot.joints, "vias": robot.vias, "drives": robot.drives}
    parts = {"measured": day.measured, "holdout": day.holdout}
    return {
        "units": {name: instrument.unit for name, instrument in units.items()},
        "kinds": {c.name: c.kind for c in listed},
        "quantities": {c.name: c.quantity for c in listed},
        "noise": {name: instrument.sigma for name, instrument in units.items()},
        "rate": day.trials[0].rate,
        "flags": [] if day.camera else ["no_mocap"],
        "built": {group: [_numbers(item) for item in items] for group, items in groups.items()},
        "session_s": day.trials[-1].start + float(day.trials[-1].time[-1]),
        "trials": {part: len(trials) for part, trials in parts.items()},
        "samples": {part: sum(len(t.command) for t in trials) for part, trials in parts.items()},
    }


def _numbers(item: Any) -> Mapping[str, Any]:
    return {f.name: getattr(item, f.name) for f in fields(item)}


def _plain(value: Any) -> Any:
    return value.tolist()
