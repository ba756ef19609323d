"""A day of a robot that plain MuJoCo steps: its own MJCF, as built and with one effect, driven by drawn controls.

It is no independent simulator of mechanics, and none is needed: what it tests is what a stranger does, `twin new NAME --mjcf`, a
log, `twin diagnose`, on models that nobody tuned the program to. Steps of 0.1 ms stand for continuous time.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).parent
STEP, ROW, LASTS, SETTLES, TRIALS = 1e-4, 1e-2, 6.0, 4.0, 8  # s
ANGLE_NOISE, LENGTH_NOISE = 1e-3, 5e-5  # rad, m
MASS_SPREAD, SPRING_SPREAD, DAMPER_SPREAD = 0.02, 0.07, 0.2  # of a number, one standard deviation
WAVES, SLOWEST, FASTEST = 3, 0.15, 1.0  # of a control: sines, and their frequencies, Hz
STEPS_EVERY, STEPS_PER_UNIT = 3, 1.5  # every third trial moves in steps


@dataclass(frozen=True)
class Sizes:
    """The elements that effects act on in one model, and how much."""

    joint: str
    friction: float  # N m
    stiffness: float  # N m/rad
    inertia: float  # kg m^2
    tip: tuple[str, str]  # a site and its body
    payload: float  # kg
    actuator: str
    tilt: float  # deg


MODELS = {
    "servo_arm": Sizes("lift", 0.15, 0.8, 0.02, ("tool", "hand"), 0.08, "lift", 3.0),
    "cable_finger": Sizes("mcp", 4e-3, 0.03, 5e-5, ("tip", "distal"), 8e-3, "flex", 8.0),
    "gripper_arm": Sizes("swing", 0.1, 1.0, 0.01, ("left_tip", "left"), 0.03, "swing", 4.0),
}


@dataclass
class Plant:
    """A model, and what happens between its controls, its motion and the log."""

    spec: mujoco.MjSpec
    sizes: Sizes
    delay: float = 0.0  # s
    lag: float = 0.0  # s
    offset: float = 0.0  # rad, of the encoder at `sizes.joint`


def _rub(p: Plant) -> None:
    joint = p.spec.joint(p.sizes.joint)
    joint.frictionloss, joint.solref_friction, joint.solimp_friction = p.sizes.friction, [4e-3, 1.0], [0.99, 0.999, 1e-3, 0.5, 2.0]


def _stiffen(p: Plant) -> None:
    joint = p.spec.joint(p.sizes.joint)
    joint.stiffness[0] += p.sizes.stiffness


def _weigh_down(p: Plant) -> None:
    site, body = p.sizes.tip
    weight = p.spec.body(body).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[2e-3, 0.0, 0.0], contype=0, conaffinity=0)
    weight.pos, weight.mass = p.spec.site(site).pos, p.sizes.payload


def _load_rotor(p: Plant) -> None:
    p.spec.joint(p.sizes.joint).armature += p.sizes.inertia


def _weaken(p: Plant) -> None:
    actuator = p.spec.actuator(p.sizes.actuator)
    actuator.gainprm, actuator.biasprm = 0.85 * actuator.gainprm, 0.85 * actuator.biasprm


def _tilt(p: Plant) -> None:
    angle = np.radians(p.sizes.tilt)
    p.spec.option.gravity = 9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)])


def _come_late(p: Plant) -> None:
    p.delay = 0.03


def _filter(p: Plant) -> None:
    p.lag = 0.04


def _turn_encoder(p: Plant) -> None:
    p.offset = np.radians(1.5)


EFFECTS: dict[str, Callable[[Plant], None]] = {
    "none": lambda p: None, "joint_friction": _rub, "joint_stiffness": _stiffen, "tip_payload": _weigh_down,
    "reflected_inertia": _load_rotor, "actuator_gain": _weaken, "base_tilt": _tilt, "time_delay": _come_late,
    "actuator_lag": _filter, "encoder_offset": _turn_encoder,
}  # fmt: skip


def write_log(name: str, effect: str, folder: Path, seed: int) -> None:
    """Fill the empty log of a folder that `twin new --mjcf` has written: `folder/samples/first`."""
    rng = np.random.default_rng(seed)
    plant = Plant(mujoco.MjSpec.from_file(str(HERE / f"{name}.xml")), MODELS[name])
    EFFECTS[effect](plant)
    _build(plant.spec, rng)
    plant.spec.option.timestep = STEP
    model = plant.spec.compile()
    log, made = folder / "samples/first", []
    for k in range(TRIALS):
        time, controls = _controls(model, rng, steps=k % STEPS_EVERY == STEPS_EVERY - 1)
        rows = np.column_stack([time, controls, _moved(plant, model, time, controls)])
        _add_noise(plant, model, rows, rng)
        made.append(rows)
    names = _columns(model)
    for old in log.glob("*.csv"):
        old.unlink()
    for k, rows in enumerate(made):
        with open(log / f"trial_{k + 1}.csv", "w", newline="") as file:
            csv.writer(file).writerows([names, *([f"{x:.7g}" for x in row] for row in rows)])
    (log / "measurements.toml").write_text(_contract((log / "measurements.toml").read_text(), model))


def _build(spec: mujoco.MjSpec, rng: np.random.Generator) -> None:
    """Let the numbers of a model differ as those of a built robot do."""
    for body in spec.bodies:
        for geom in body.geoms:
            if np.isfinite(geom.mass):
                geom.mass *= 1.0 + MASS_SPREAD * rng.normal()
    for joint in spec.joints:
        joint.damping[0] *= 1.0 + DAMPER_SPREAD * rng.normal()
        joint.armature *= 1.0 + DAMPER_SPREAD * rng.normal()
        joint.stiffness[0] *= 1.0 + SPRING_SPREAD * rng.normal()


def _controls(model: mujoco.MjModel, rng: np.random.Generator, steps: bool) -> tuple[np.ndarray, np.ndarray]:
    """Draw controls (n, nu) at times (n,): sines about the middle of their ranges, or steps; tendons pull in turn."""
    time, nu = np.arange(0.0, LASTS, ROW), model.nu
    amplitude, rate, phase = (
        0.18 + 0.12 * rng.random(nu),
        rng.uniform(SLOWEST, FASTEST, (WAVES, nu)),
        rng.uniform(0, 2 * np.pi, (WAVES, nu)),
    )
    wave = np.sin(2.0 * np.pi * rate[:, None] * time[None, :, None] + phase[:, None]).sum(axis=0) / 2.0
    if steps:
        wave = np.round(STEPS_PER_UNIT * wave) / STEPS_PER_UNIT
    low, high = model.actuator_ctrlrange.T
    if (low == 0.0).all():
        pull = np.array([np.maximum(wave[:, 0], 0.0), np.maximum(-wave[:, 0], 0.0)]).T
        return time, np.clip(0.5 + high / 3.0 * pull, low, high)
    return time, np.clip((low + high) / 2.0 + (high - low) * amplitude * wave, low, high)


def _moved(plant: Plant, model: mujoco.MjModel, time: np.ndarray, controls: np.ndarray) -> np.ndarray:
    """Return the joints and sensors (n, .) of a robot that settled under its first controls and follows them."""
    data = mujoco.MjData(model)
    data.ctrl[:] = acting = controls[0].copy()
    for _ in range(round(SETTLES / STEP)):
        mujoco.mj_step(model, data)
    out, each = [], round(ROW / STEP)
    fine = np.arange(len(time) * each) * STEP - plant.delay
    course = np.stack([np.interp(fine, time, u) for u in controls.T], axis=1)
    for i in range(len(time)):
        out.append(np.concatenate([data.qpos, data.sensordata]))
        for u in course[i * each : (i + 1) * each]:
            acting = acting + (u - acting) * STEP / plant.lag if plant.lag else u
            data.ctrl[:] = acting
            mujoco.mj_step(model, data)
    return np.array(out)


def _add_noise(plant: Plant, model: mujoco.MjModel, rows: np.ndarray, rng: np.random.Generator) -> None:
    joints = slice(1 + model.nu, 1 + model.nu + model.njnt)
    rows[:, joints] += ANGLE_NOISE * rng.normal(size=(len(rows), model.njnt))
    rows[:, 1 + model.nu + model.joint(plant.sizes.joint).id] += plant.offset
    rows[:, joints.stop :] += LENGTH_NOISE * rng.normal(size=(len(rows), model.nsensordata))


def _columns(model: mujoco.MjModel) -> list[str]:
    return [
        "time", *(f"actuator.{model.actuator(i).name}.ctrl" for i in range(model.nu)),
        *(f"joint.{model.joint(i).name}.position" for i in range(model.njnt)),
        *(f"sensor.{model.sensor(i).name}" for i in range(model.nsensor)),
    ]  # fmt: skip


def _contract(written: str, model: mujoco.MjModel) -> str:
    """Return `measurements.toml` with these channels and trials: the head, and inputs' units, as `twin new` wrote them."""
    tables = [written.split("\n[[channel]]")[0]]
    for name in _columns(model)[1:]:
        kind = name.split(".")[0]
        unit = re.search(rf'name = "{re.escape(name)}"\nrole = "input"\nunit = "([^"]+)"', written)
        role, of, noise = (
            ("input", unit[1], 1e-6) if unit else ("output", *({"joint": ("rad", ANGLE_NOISE)}.get(kind, ("m", LENGTH_NOISE))))
        )
        tables.append(f'\n[[channel]]\nname = "{name}"\nrole = "{role}"\nunit = "{of}"\nnoise = {noise}\n')
    tables += [f'\n[[trial]]\nfile = "trial_{k + 1}.csv"\nstart = {60.0 * k}\n' for k in range(TRIALS)]
    return "".join(tables)
