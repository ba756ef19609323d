"""Makes one day of a rod whose motors log angles: a robot described with its motors, the trials, and the truth beside them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tools.simulators.motor_rod.drives import PRETENSION, SPOOL, SPRING, WINDINGS, DriveTrain, Winding
from tools.simulators.motor_rod.motions import motor_day
from tools.simulators.rod.amplitude import Scale, scaled
from tools.simulators.rod.bench import Log, run
from tools.simulators.rod.day import MISMATCH
from tools.simulators.rod.design import Day
from tools.simulators.rod.effects import Effect, all_effects
from tools.simulators.rod.mechanics.rod import Rod
from tools.simulators.rod.nuisance import built
from tools.simulators.rod.sensors import Noise
from tools.simulators.rod.write import write_truth
from twin.robots.robot import models_folder

ENCODER_NOISE = 0.05  # deg
TORQUE_NOISE = 2e-4  # N m
# Not on this bench: nobody reads a tension, no springs are heated, angles are measured after the drive's lag. Of a spool's radius,
# a zero and a spring in series the description says itself how far they may be off.
ELSEWHERE = ("load_cell_", "sma_", "actuator_lag", "actuator_gain", "drive_zero", "tendon_elasticity")
PER_TENDON = ("worn", "stops", "phases", "share")  # fields of effects that have one number a tendon


@dataclass(frozen=True)
class MotorRecipe:
    """What a day is made of; the same recipe gives the same bytes."""

    effects: tuple[str, ...] = ()
    amplitude: float = 3.0  # sigmas left by each effect, after refitting
    seed: int = 0
    winding: str = "pairs"  # of WINDINGS
    torque: bool = False  # also log the motors' torques
    mismatch: str = "built"  # of MISMATCH


def possible_effects() -> list[str]:
    """Return the effects that may be wrong on this bench."""
    return [name for name in all_effects() if not name.startswith(ELSEWHERE)]


def make_motor_day(folder: Path, recipe: MotorRecipe) -> list[tuple[Effect, float]]:
    """Write the day; return each effect as scaled and the sigmas it leaves."""
    robot, motions, instruments, laws, motors = (np.random.default_rng([recipe.seed, n]) for n in range(5))
    winding, spread = WINDINGS[recipe.winding], MISMATCH[recipe.mismatch]
    angles = 2.0 * np.pi * np.arange(len(winding.motor)) / len(winding.motor)
    rod = built(robot, _described(angles), spread)
    train, day = DriveTrain.built(motors, winding, spread), motor_day(angles, motions)
    noise = Noise.draw(instruments, coloured=False)
    scale = Scale(rod, day, noise, (train,), tuple(train.moved()))
    found = [scaled(_drawn(name, laws, len(angles)), recipe.amplitude, scale) for name in recipe.effects]
    logs = run(rod, [*(effect for effect, _ in found), train], day)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot").mkdir(exist_ok=True)
    (folder / "robot" / "robot.toml").write_text(_robot_text(winding, angles))
    _write_set(folder, recipe, winding, day, logs, noise, instruments)
    made: dict[str, int | str] = {"seed": recipe.seed, "design": recipe.winding, "mismatch": recipe.mismatch}
    write_truth(folder, made, rod, [*found, (train, 0.0)], noise)
    return found


def _described(angles: np.ndarray) -> Rod:
    rod = Rod()
    n, t = len(rod.pitch), len(angles)
    return replace(rod, hole_radius=np.full((n + 1, t), rod.hole_radius[0, 0]), hole_angle=np.tile(angles, (n + 1, 1)))


def _drawn(name: str, rng: np.random.Generator, tendons: int) -> Effect:
    """Draw an effect; what has a number a tendon repeats the first for a fourth."""
    effect = all_effects()[name].draw(rng)
    lists = {key: getattr(effect, key) for key in PER_TENDON if isinstance(getattr(effect, key, None), tuple)}
    return replace(effect, **{key: (value + value)[:tendons] for key, value in lists.items()})


def _robot_text(winding: Winding, angles: np.ndarray) -> str:
    """Return the robot.toml: the reference robot with its motors."""
    text = (models_folder() / "continuum/robot.toml").read_text("utf-8")
    wound = [[winding.way[t] * (t + 1) for t, m in enumerate(winding.motor) if m == k] for k in range(winding.motors)]
    zeros, spread = [0.0] * winding.motors, np.degrees(winding.zero_spread)
    drives = f"""
"motors.radius" = {{ value = {1e3 * SPOOL}, unit = "mm", std = {20 * SPOOL}, source = "drawing; turned to 2 %" }}
"motors.zero" = {{ value = {zeros}, unit = "deg", std = {spread:.3g}, source = "set by hand" }}
"tendons.pretension" = {{ value = {[PRETENSION] * len(angles)}, unit = "N", std = {0.15 * PRETENSION}, source = "set by hand" }}
"tendons.stretch" = {{ value = {1e3 * SPRING}, unit = "mm/N", std = {100 * SPRING}, source = "springs of the pretensioners, 10 %" }}
"""
    text = text.replace("tendons = 3", f"tendons = {len(angles)}\nmotors = {wound}")
    text = text.replace("value = [0.0, 120.0, 240.0]", f"value = {np.degrees(angles).round(6).tolist()}")
    return text.replace('"damping.time"', drives.lstrip() + '"damping.time"')


def _write_set(
    folder: Path, recipe: MotorRecipe, winding: Winding, day: Day, logs: Sequence[Log], noise: Noise, rng: np.random.Generator
) -> None:
    first = [winding.first_of(m) for m in range(winding.motors)]
    way, disks = np.array([winding.way[t] for t in first]), logs[0].markers.shape[1]
    channels = [(f"motor_{m + 1}_angle", "input", "deg", ENCODER_NOISE) for m in range(winding.motors)]
    channels += [(f"disk_{k + 1}_{x}", "output", "mm", 1e3 * noise.marker) for k in range(disks) for x in "xyz"]
    channels.append(("ambient_temperature", "context", "degC", noise.ambient))
    if recipe.torque:
        channels += [(f"motor_{m + 1}_torque", "output", "N*m", TORQUE_NOISE) for m in range(winding.motors)]
    lines = [
        'format  = "twin-measurements/1"',
        'robot   = "robot"',
        f'title   = "Motor-driven rod, day {recipe.seed}"',
        'source  = "simulation: independent Kirchhoff rod with motors"',
        f"gravity = {list(day.gravity)}",
    ]
    for name, role, unit, sigma in channels:
        lines += ["", "[[channel]]", f'name = "{name}"', f'role = "{role}"', f'unit = "{unit}"', f"noise = {sigma:.4g}"]
    for log in logs:
        n, file = len(log.trial.time), f"{log.trial.name}.csv"
        angle = np.degrees(way * log.displacement[:, first] / SPOOL) + ENCODER_NOISE * rng.normal(size=(n, winding.motors))
        columns = [angle, 1e3 * noise.of_markers(rng, log.markers).reshape(n, -1)]
        columns.append((log.ambient + noise.ambient * rng.normal(size=n))[:, None])
        if recipe.torque:
            each = np.array(winding.way) * log.tension * SPOOL
            torque = np.stack([each[:, np.array(winding.motor) == m].sum(axis=1) for m in range(winding.motors)], axis=1)
            columns.append(torque + TORQUE_NOISE * rng.normal(size=torque.shape))
        _write_csv(folder / file, [c[0] for c in channels], log.trial.time, np.hstack(columns))
        lines += ["", "[[trial]]", f'file = "{file}"', f"start = {log.trial.start}"]
        lines.append(f'tip_payload = "{1e3 * log.trial.payload:g} g"')
    (folder / "measurements.toml").write_text("\n".join(lines) + "\n")


def _write_csv(path: Path, names: list[str], time: np.ndarray, values: np.ndarray) -> None:
    rows = [",".join(["time", *names])]
    rows += [",".join([f"{t:.4f}", *("" if np.isnan(v) else f"{v:.5f}" for v in row)]) for t, row in zip(time, values, strict=True)]
    path.write_text("\n".join(rows) + "\n")


def truth_of(folder: Path) -> list[dict]:
    """Return the effects of a day, as truth.json has them."""
    found = json.loads((folder / "truth.json").read_text())["effects"]
    return [e for e in found if e["id"] != DriveTrain.id]
