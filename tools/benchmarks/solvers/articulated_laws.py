"""Each law of an MJCF against the independent simulator of tools/simulators/articulated, with equal numbers on both sides.

    python -m tools.benchmarks.solvers.articulated_laws [--robot leg] [--effect joint_friction]

Nothing is fitted: a difference beyond the steps' own is an error of a law, here or there. The table has the
difference and what the effect moves, each as the root mean square over all channels in their noise.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro

from tools.benchmarks.table import markdown
from tools.simulators.articulated.bench import Trial, channels, command_unit, observe
from tools.simulators.articulated.describe import write_robot
from tools.simulators.articulated.drives import all_effects
from tools.simulators.articulated.effects import Effect
from tools.simulators.articulated.plant import plant
from tools.simulators.articulated.robots import ROBOTS, Robot
from tools.simulators.articulated.trials import session
from twin.effects import effect_class
from twin.measurements import Channel as Column
from twin.measurements import Recording
from twin.measurements import Trial as Log
from twin.prediction.twin import Twin

TRIALS = ("steps", "chirp", "slow", "fast")  # kinds
# Strengths at which an effect is worth some standard deviations; 1 is the usual one of `Effect.draw`.
STRENGTH = {"joint_stop": 4.0, "tip_payload": 3.0, "actuator_saturation": 2.0}
NOT_COMPARED = {"sensor_drift": "the simulator's levels off in its own time"}


def equal_numbers(robot: Robot, effect: Effect) -> dict[str, float]:
    """Return the twin's numbers of a simulator's effect."""
    s, joints, e = effect.strength, [j.name for j in robot.joints], vars(effect)

    def at(ones: np.ndarray) -> int:
        return int(np.argmax(np.abs(ones)))

    def drive() -> int:
        on = {j for j, x in zip(joints, e["servo"], strict=True) if x}
        on |= {w.target for w, x in zip(robot.winches, e["tendon"], strict=True) if x}
        return next(i for i, d in enumerate(robot.drives, 1) if d.target in on)

    match effect.id:
        case "joint_friction":
            law = {"presliding": e["give"], "breakaway": e["stribeck"], "stribeck": e["speed"], "viscous": e["viscous"]}
            return law | {f"torque_{j}": s * x for j, x in zip(joints, e["size"], strict=True)}
        case "load_dependent_friction":
            return {"share": s, "presliding": plant(robot, 0.0).rubbing.give}
        case "reflected_inertia":
            return {f"inertia_{joints[at(e['joint'])]}": s * robot.joints[at(e["joint"])].armature}
        case "joint_stiffness":
            k, name = s * float(np.max(e["size"])), joints[at(e["size"])]
            return {f"stiffness_{name}": k, f"preload_{name}": k * e["rest"]}
        case "joint_stop":
            K, D = robot.stop
            return {f"upper_{joints[at(e['joint'])]}": e["reach"] - s, "give": 1.0 / K, "loss": D / K}
        case "tip_payload":
            return {"mass": s}
        case "base_tilt":
            return {"about_y": -s * e["side"]}
        case "tendon_friction":
            mu = {f"mu_{w.target}": s * x for w, x in zip(robot.winches, e["share"], strict=True)}
            return mu | {"presliding": plant(robot, 0.0).tendons.slip}
        case "tendon_elasticity":
            return {f"stretch_{robot.winches[at(e['tendon'])].target}": 1e-3 * s}
        case "tendon_backlash" | "drive_zero" as name:
            number = {"tendon_backlash": "play", "drive_zero": "zero"}[name]
            return {f"{number}_{at(e['drive']) + 1}": 1e-3 * s * float(e["drive"][at(e["drive"])])}
        case "actuator_gain":
            return {f"gain_{drive()}": 1.0 - s}
        case "actuator_saturation":
            return {f"limit_{drive()}": (1.0 - s) * e["peak"]}
        case "actuator_lag":
            return {"time": 1e-3 * s}
        case "time_delay":
            return {"delay": 1e-3 * s}
        case "encoder_offset":
            return {f"offset_{e['channel'].removesuffix('_angle')}": float(np.deg2rad(s * e["side"]))}
        case "camera_misalignment":
            x, z = 1e-3 * s * e["offset"]
            return {"turn_y": -s * e["side"], "shift_x": x, "shift_z": z}
        case other:
            raise KeyError(f"{other}: the twin's numbers for it are not written here")


@dataclass(frozen=True)
class Compared:
    """The difference between twin and simulator, and what the effect moves, both in standard deviations of the noise."""

    robot: str
    effect: str  # empty: the robot as described
    difference: float
    moved: float


def compare(name: str, only: str = "", each: int = 2, seed: int = 5) -> Iterator[Compared]:
    """Yield the comparisons of one robot, as described and with each effect (or `only` one), on so many trials of `each` kind."""
    robot = ROBOTS[name]()
    day = session(robot, np.random.default_rng(seed), camera=True)
    trials = [t for kind in TRIALS for t in [t for t in day.measured if t.name.startswith(kind)][:each]]
    known = [e for e in all_effects().values() if e.in_catalogue and e.fits(robot) and e.id not in NOT_COMPARED]
    plain: np.ndarray | None = None
    for effect in (None, *(e for e in known if only in ("", e.id))):
        drawn = []
        if effect is not None:
            usual = effect.draw(robot, np.random.default_rng(seed + 2))
            drawn = [replace(usual, strength=min(usual.strength * STRENGTH.get(effect.id, 1.0), usual.most))]
        seen = _recorded(robot, trials, drawn)
        with tempfile.TemporaryDirectory() as folder:
            write_robot(Path(folder), robot)
            twin = Twin.load(Path(folder))
            for e in drawn:
                twin = twin.with_effect(effect_class(e.id)(equal_numbers(robot, e), twin.robot.n_tendon))
            wanted, found = _in_noise(seen), _in_noise(twin.predict(seen))
        plain = wanted if plain is None else plain
        off, moved = (float(np.sqrt(np.mean(x**2))) for x in (found - wanted, wanted - plain))
        yield Compared(name, effect.id if effect else "", off, moved)


def _recorded(robot: Robot, trials: list[Trial], effects: list[Effect]) -> Recording:
    """Return what perfect instruments show of the trials."""
    listed = channels(robot, camera=True)
    columns = [Column(f"{d.target}_command", "input", command_unit(d)[0], quantity=f"actuator.{d.name}.ctrl") for d in robot.drives]
    for c in listed:
        instrument = robot.instruments[c.instrument]
        columns.append(Column(c.name, "output", instrument.unit, instrument.sigma / instrument.scale, c.quantity))
    logs = []
    for trial in trials:
        shown = observe(robot, effects, trial)
        values = {f"{d.target}_command": trial.command[:, i] for i, d in enumerate(robot.drives)}
        values |= {c.name: shown[c.name] / robot.instruments[c.instrument].scale for c in listed}
        logs.append(Log(f"{trial.name}.csv", trial.time, values, start=trial.start))
    return Recording(robot.name, "made", "simulation", None, tuple(columns), tuple(logs))


def _in_noise(recording: Recording) -> np.ndarray:
    """Return all outputs of a recording, one trial after the other, each in its noise."""
    outputs = [c for c in recording.channels if c.role == "output"]
    return np.concatenate([np.stack([t.values[c.name] / c.noise for c in outputs], axis=1) for t in recording.trials])


def main(robot: str = "", effect: str = "") -> None:
    """Print the table.

    Args:
        robot: one of tools/simulators/articulated/robots.py; empty: each
        effect: one effect; empty: each that a robot may have
    """
    rows = [found for name in ROBOTS if robot in ("", name) for found in compare(name, effect)]
    lines = [[r.robot, r.effect or "none", f"{r.difference:.2f}", f"{r.moved:.1f}"] for r in rows]
    print(markdown(["robot", "effect", "difference", "moved"], lines))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
