"""The calibration of an MJCF against `mujoco.sysid`: the same days, trials, free numbers, descriptions and noise.

    pip install "mujoco[sysid]"
    python -m tools.benchmarks.solvers.against_sysid [--days 3] [--seed 71000]

Days are of servo arms and legs of the independent simulator, without an effect, less their trials with a payload. `mujoco.sysid`
takes the model's own steps and runs as it comes, but for the size of its differences and the times of its readings; descriptions
enter as residuals (x - described) / std. The table has for both the seconds and |z|^2 over n, z in the declared noise, as the twin
predicts, and the largest difference of a number in standard errors.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import tyro
from mujoco import sysid

from tools.benchmarks.table import markdown
from tools.simulators.articulated.day import Recipe, make_set
from twin.diagnosis import Settings
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.held_out import predicted
from twin.diagnosis.pipeline import calibrated_fit
from twin.diagnosis.split import split
from twin.measurements import Recording, read
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.twin import Twin
from twin.robots.families.mjcf import build

ROBOTS = ("servo_arm", "leg")
HOLD = 2.0  # s that a model settles under its first command, before its log begins
DIFFERENCE = 1e-2  # of a standard deviation; the default, 1.5e-8, is below the rounding of motion
SENSORS = {
    ("joint", "position"): '<jointpos name="{0}" joint="{1}"/>',
    ("actuator", "position"): '<actuatorpos name="{0}" actuator="{1}"/>',
    ("actuator", "force"): '<actuatorfrc name="{0}" actuator="{1}"/>',
    **{("site", axis): '<framepos name="{0}" objtype="site" objname="{1}"/>' for axis in "xyz"},
}


@dataclass(frozen=True)
class Outcome:
    """What a tool found: numbers by how many standard deviations they are off their description, |z|^2 over n, and seconds."""

    x: np.ndarray
    misfit: float
    seconds: float


def compare(folder: Path, recipe: Recipe, threads: int) -> tuple[Outcome, Outcome, Fit]:
    """Return what the twin and `mujoco.sysid` find on one day, and the twin's fit."""
    make_set(folder, recipe)
    recording = read(folder / "measured")
    recording = replace(recording, trials=tuple(t for t in recording.trials if not t.conditions))
    _add_sensors(folder / "measured" / "robot", recording)
    twin, settings = Twin.of_recording(recording), Settings(seed=recipe.seed, jobs=threads)
    began = time.perf_counter()
    fitted, _, _ = calibrated_fit(recording, twin, settings)
    seconds = time.perf_counter() - began
    prepared = prepare(recording, twin.robot)
    trials, _ = split(prepared, settings.seed)
    std = np.array([f.parameter.std for f in fitted.model.free], float)
    x = np.array([fitted.model.value(f) - f.parameter.value for f in fitted.model.free]) / std
    mine = Outcome(x, _misfit(fitted.model.twin, prepared, trials), seconds)
    began = time.perf_counter()
    theirs = by_sysid(prepared, trials, fitted.model, threads)
    seconds = time.perf_counter() - began
    values = {f.parameter.name: f.parameter.value + s * t for f, s, t in zip(fitted.model.free, std, theirs, strict=True)}
    other = replace(fitted.model.twin, values={**fitted.model.twin.values, **values})
    return mine, Outcome(theirs, _misfit(other, prepared, trials), seconds), fitted


def by_sysid(prepared: PreparedRecording, trials: list[int], model: Model, threads: int) -> np.ndarray:
    """Return the free numbers of a model as `mujoco.sysid` finds them, in standard deviations off their description."""
    free, robot = [f.parameter for f in model.free], prepared.robot
    described = {p.name: p.value for p in robot.parameters}
    std = np.array([p.std for p in free], float)

    def model_of(params: sysid.ParameterDict, _: object = None) -> mujoco.MjModel:
        moved = {p.name: p.value + s * x for p, s, x in zip(free, std, params.as_vector(), strict=True)}
        return build(robot.structure, described | moved).model

    params = sysid.ParameterDict()
    for p, s in zip(free, std, strict=True):
        params.add(sysid.Parameter(p.name, nominal=0.0, min_value=(p.low - p.value) / s, max_value=(p.high - p.value) / s))
    base = model_of(params)
    at = np.array([base.sensor(o.channel.name).adr[0] + (o.axis if o.group == "marker" else 0) for o in prepared.outputs])
    noise = np.array([o.channel.noise for o in prepared.outputs], float)
    control, shown = [], []
    for k in trials:
        log, seen = prepared.inputs[k], np.zeros((len(prepared.inputs[k].time), base.nsensordata))
        seen[:, at] = prepared.measured[k]
        time_of = log.time - log.time[0] + HOLD
        held = np.vstack([log.command[:1], log.command])
        control.append(sysid.TimeSeries.from_control_names(np.concatenate([[0.0], time_of]), held, base))
        shown.append(sysid.TimeSeries.from_names(time_of, seen, base))
    start = sysid.create_initial_state(base, base.qpos0, np.zeros(base.nv), np.zeros(base.na))
    day = sysid.ModelSequences(
        "day", build(robot.structure, described).spec, [f"trial_{k}" for k in trials], [start] * len(trials), control, shown
    )

    def in_noise(params: object, predicted: Any, measured: Any, *rest: object, **more: object) -> tuple[np.ndarray, Any, Any]:
        shown = predicted.resample(measured.times + base.opt.timestep)  # readings of a step bear the time of its end
        return (shown.data - measured.data)[:, at] / noise, shown, shown  # it compares what it was told of both

    def residual(x: np.ndarray, params: sysid.ParameterDict, **more: Any) -> tuple[list[np.ndarray], Any, Any]:
        found, *rest = sysid.residual(x, params, [day], build_model=model_of, modify_residual=in_noise, n_threads=threads, **more)
        return [*found, np.asarray(x)], *rest

    best, _ = sysid.optimize(params, residual, verbose=False, eps=DIFFERENCE)
    return np.asarray(best.as_vector())


def _add_sensors(folder: Path, recording: Recording) -> None:
    """Give the model of a folder one sensor for each output channel, of the channel's name."""
    (model,), lines = folder.glob("*.xml"), []
    for channel in recording.channels:
        if channel.role == "output":
            kind, element, what = str(channel.quantity).split(".")
            lines.append(SENSORS[kind, what].format(channel.name, element))
    model.write_text(model.read_text().replace("</mujoco>", f"<sensor>{''.join(lines)}</sensor></mujoco>"))


def _misfit(twin: Twin, prepared: PreparedRecording, trials: list[int]) -> float:
    """Return the mean square of measured less predicted in the declared noise."""
    noise = np.array([o.channel.noise for o in prepared.outputs], float)
    shown = predicted(twin, prepared, trials)
    z = np.concatenate([((prepared.measured[k] - y) / noise).ravel() for k, y in zip(trials, shown, strict=True)])
    return float(np.nanmean(z**2))


def main(days: int = 3, seed: int = 71000, threads: int = 2) -> None:
    """Print the table.

    Args:
        days: of each robot
        threads: of both
    """
    lines: list[list[object]] = []
    for k in range(days):
        for robot in ROBOTS:
            with tempfile.TemporaryDirectory() as folder:
                recipe = Recipe(robot, (), 1.0, seed + k)
                mine, theirs, fitted = compare(Path(folder), recipe, threads)
            std = np.array([f.parameter.std for f in fitted.model.free], float)
            apart = float(np.max(np.abs(mine.x - theirs.x) * std / fitted.std()))
            cells = [f"{o.seconds:.0f} s, {o.misfit:.4f}" for o in (mine, theirs)]
            lines.append([f"{robot} {seed + k}", len(std), *cells, f"{theirs.seconds / mine.seconds:.1f}", f"{apart:.2f}"])
            print(lines[-1], flush=True)
    head = ["day", "numbers", "twin: time, misfit", "sysid: time, misfit", "ratio of times", "apart, standard errors"]
    print(markdown(head, lines))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
