"""Bench days of a planar two-link finger by Lagrange's equations, integrated in time; it shares nothing with the twin.

    M(q) q'' + c(q, q') + b q' + dV/dq = r_j sum_i a_i T_ij,     V = sum_j k_j (q_j - rest_j)^2 / 2 - sum m g . p(q)
    T_ij = T_i exp(-mu sum_{l<=j} (wrap + a_i q_l) z_il),     z_il' = v_il / D - |v_il| z_il / D,     v_il = a_i sum_{m>=l} r_m q_m'

with the masses in the middle of the links and the payload at the tip. A day is a folder as a bench would write it, with one thing
in it that the description of `models/two_link` does not know, or nothing. Source: textbook double pendulum; Euler-Eytelwein; Dahl
(1968) for what friction does before it slides.

    python -m tools.simulators.two_link OUT --effect tendon_friction --seed 3
"""

import csv
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numba import njit

TWO_LINK_GRAVITY = 9.81  # m/s^2
DAMPING = 1e-4  # N m s/rad: slow motions lag by less than the encoders show
GIVES = 5e-5  # m, D: over which a tendon comes from sticking to sliding
INTEGRATION_STEP = 5e-4  # s: a tenth of the fastest mode's time, friction sticking
REST_UNDER_LOADS = 5.0  # s before that, under the loads alone
SIDEWAYS = 0.5 * np.pi
EASE = 8.0  # s over which the first tensions come on, before the log starts
SIGMA = {"angle": np.deg2rad(0.1), "tip": 2e-4, "tension": 0.01}


@dataclass(frozen=True)
class Plant:
    """A built finger and what is wrong with it."""

    length: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray
    radius: np.ndarray
    wrap: float = np.deg2rad(60.0)
    mu: float = 0.0
    hung: float = 0.0  # kg that nobody weighed
    tilt: float = 0.0  # rad about y
    softer: float = 0.0  # 1/K
    limit: float = np.inf  # N a drive delivers


@dataclass(frozen=True)
class Planned:
    """A trial: how long, its base tensions as a function of time, payload (kg), how the finger is mounted, start (s)."""

    name: str
    seconds: float
    tension: Callable[[np.ndarray], np.ndarray]  # (n,) s -> (n, 2) N
    payload: float = 0.0
    mount: float = 0.0  # rad about y, from hanging
    rows: float = 3.0  # a second
    start: float = 0.0


def built(rng: np.random.Generator) -> Plant:
    """A finger within the tolerances its description states."""
    return Plant(
        np.array([0.05, 0.04]) + rng.normal(0, 2e-4, 2), np.array([0.012, 0.008]) + rng.normal(0, 4e-4, 2),
        np.array([0.06, 0.04]) + rng.normal(0, 3e-3, 2), rng.normal(0, np.deg2rad(0.5), 2),
        np.array([7e-3, 5e-3]) + rng.normal(0, 1e-4, 2),
    )  # fmt: skip


@njit(cache=True)
def rates(y, T, k, g, plant, masses):
    """y' of y = (q, q', z of tendon 1, z of tendon 2) under tensions T, gravity g (x, z)."""
    L1, L2, r1, r2, rest1, rest2, wrap, mu = plant
    m1, m2, mp = masses
    q1, q2, w1, w2 = y[0], y[1], y[2], y[3]
    c1, s1, c12, s12, c2, s2 = np.cos(q1), np.sin(q1), np.cos(q1 + q2), np.sin(q1 + q2), np.cos(q2), np.sin(q2)
    M12 = m2 * (L2**2 / 4 + L1 * L2 * c2 / 2) + mp * (L2**2 + L1 * L2 * c2)
    M22 = m2 * L2**2 / 4 + mp * L2**2
    M11 = m1 * L1**2 / 4 + (m2 + mp) * L1**2 + M22 + L1 * L2 * c2 * (m2 + 2 * mp)
    h = -(m2 / 2 + mp) * L1 * L2 * s2
    second = (m2 / 2 + mp) * L2 * (g[0] * c12 - g[1] * s12)  # gravity along the motion of each link's end
    first = (m1 / 2 + m2 + mp) * L1 * (g[0] * c1 - g[1] * s1) + second
    f1 = first - k[0] * (q1 - rest1) - DAMPING * w1 - h * (2 * w1 * w2 + w2**2)
    f2 = second - k[1] * (q2 - rest2) - DAMPING * w2 + h * w1**2
    out = np.empty(8)
    for i in range(2):
        a, z1, z2 = 1.0 - 2.0 * i, y[4 + 2 * i], y[5 + 2 * i]
        one, two = (wrap + a * q1) * z1, (wrap + a * q2) * z2
        f1 += a * r1 * T[i] * np.exp(-mu * one)
        f2 += a * r2 * T[i] * np.exp(-mu * (one + two))
        v1, v2 = a * (r1 * w1 + r2 * w2), a * r2 * w2
        out[4 + 2 * i], out[5 + 2 * i] = (v1 - abs(v1) * z1) / GIVES, (v2 - abs(v2) * z2) / GIVES
    det = M11 * M22 - M12 * M12
    out[0], out[1], out[2], out[3] = w1, w2, (M22 * f1 - M12 * f2) / det, (M11 * f2 - M12 * f1) / det
    return out


@njit(cache=True)
def march(T, k, g, plant, masses):
    """Runge-Kutta of fourth order from rest; T (2 n + 1, 2) N at half steps. Joint angles (n + 1, 2)."""
    n = (len(T) - 1) // 2
    y, q = np.zeros(8), np.zeros((n + 1, 2))
    for i in range(n):
        a = rates(y, T[2 * i], k, g, plant, masses)
        b = rates(y + 0.5 * INTEGRATION_STEP * a, T[2 * i + 1], k, g, plant, masses)
        c = rates(y + 0.5 * INTEGRATION_STEP * b, T[2 * i + 1], k, g, plant, masses)
        d = rates(y + INTEGRATION_STEP * c, T[2 * i + 2], k, g, plant, masses)
        y = y + INTEGRATION_STEP / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        q[i + 1] = y[:2]
    return q


def moved(plant: Plant, trial: Planned, warm: float, time: np.ndarray) -> np.ndarray:
    """Joint angles (n, 2) rad at the times: straight, its loads, the first tensions, the log; `warm` K above 23 degC."""
    t = np.arange(-EASE - REST_UNDER_LOADS, trial.seconds + INTEGRATION_STEP, 0.5 * INTEGRATION_STEP)
    t = t[: len(t) - 1 + len(t) % 2]
    T = np.minimum(trial.tension(np.maximum(t, 0.0)), plant.limit) * np.clip(1.0 + t / EASE, 0.0, 1.0)[:, None]
    turned = plant.tilt + trial.mount
    g = TWO_LINK_GRAVITY * np.array([np.sin(turned), np.cos(turned)])
    numbers = np.array([*plant.length, *plant.radius, *plant.rest, plant.wrap, plant.mu])
    masses = np.array([*plant.mass, trial.payload + plant.hung])
    q = march(np.ascontiguousarray(T), plant.stiffness * (1.0 - plant.softer * warm), g, numbers, masses)
    return np.stack([np.interp(time, t[::2], column) for column in q.T], axis=1)


def tip(plant: Plant, q: np.ndarray) -> np.ndarray:
    both = q.sum(axis=1)
    x = plant.length[0] * np.sin(q[:, 0]) + plant.length[1] * np.sin(both)
    z = plant.length[0] * np.cos(q[:, 0]) + plant.length[1] * np.cos(both)
    return np.stack([x, np.zeros_like(x), z], axis=1)


def planned(rng: np.random.Generator) -> list[Planned]:
    """Pulls of each tendon and both, slow and fast, holds, two payloads, two mounts, two repeats; random order through the day."""

    def pull(top1: float, top2: float, seconds: float, base: float = 0.3) -> Callable[[np.ndarray], np.ndarray]:
        def tension(t: np.ndarray) -> np.ndarray:
            bump = np.sin(np.pi * np.clip(t / seconds, 0.0, 1.0)) ** 2
            return np.stack([base + top1 * bump, base + top2 * bump], axis=1)

        return tension

    def wander(seconds: float, phase: float) -> Callable[[np.ndarray], np.ndarray]:
        def tension(t: np.ndarray) -> np.ndarray:
            u = 2 * np.pi * np.clip(t, 0.0, None) / seconds
            return np.stack([2.0 - 1.7 * np.cos(2 * u + phase * u), 1.2 - 0.9 * np.cos(3 * u)], axis=1)

        return tension

    def hold(level: float) -> Callable[[np.ndarray], np.ndarray]:
        def tension(t: np.ndarray) -> np.ndarray:
            return np.stack([0.3 + level * np.clip(t / 5.0, 0.0, 1.0), 0.3 + 0.0 * t], axis=1)

        return tension

    trials = [
        Planned("slow_1", 40.0, pull(4.0, 0.0, 40.0)), Planned("slow_2", 40.0, pull(0.0, 3.0, 40.0)),
        Planned("slow_1_again", 40.0, pull(4.0, 0.0, 40.0)), Planned("both", 40.0, pull(3.0, 2.0, 40.0)),
        Planned("both_again", 40.0, pull(3.0, 2.0, 40.0)), Planned("fast_1", 4.0, pull(4.0, 0.0, 4.0), rows=20.0),
        Planned("fast_2", 4.0, pull(0.0, 3.0, 4.0), rows=20.0), Planned("hold", 60.0, hold(3.0)),
        Planned("wander_1", 60.0, wander(60.0, 0.0)), Planned("sideways", 40.0, pull(4.0, 0.0, 40.0), mount=SIDEWAYS),
        Planned("sideways_loaded", 40.0, pull(4.0, 0.0, 40.0), 0.02, SIDEWAYS),
        Planned("sideways_both", 40.0, pull(3.0, 2.0, 40.0), mount=SIDEWAYS),
        Planned("wander_2", 60.0, wander(60.0, 0.5)), Planned("slow_1_loaded", 40.0, pull(4.0, 0.0, 40.0), 0.02),
        Planned("wander_loaded", 60.0, wander(60.0, 1.0), 0.02), Planned("slow_2_loaded", 40.0, pull(0.0, 3.0, 40.0), 0.02),
    ]  # fmt: skip
    out, now = [], 0.0
    for n in rng.permutation(len(trials)):
        out.append(replace(trials[n], start=now))
        now += trials[n].seconds + 60.0
    return out


def write_day(folder: Path, effect: str | None, seed: int) -> None:
    """Writes a measurement set with `effect` in it, or none."""
    rng = np.random.default_rng(seed)
    plant, size = built(rng), rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 1.6)
    gain, bias, drift, cross, delay = np.ones(2), np.zeros(2), np.zeros(2), np.zeros((2, 2)), 0.0
    if effect == "tendon_friction":
        plant = replace(plant, mu=0.08 * abs(size))
    elif effect == "load_cell_gain":
        gain[rng.integers(2)] += 0.06 * size
    elif effect == "load_cell_bias":
        bias[rng.integers(2)] += 0.3 * size  # less is what a joint's rest angle may be off by
    elif effect == "load_cell_drift":
        drift[rng.integers(2)] += 0.4 * size / 3600.0
    elif effect == "load_cell_crosstalk":
        cross[0, 1] = 0.06 * size
    elif effect == "tip_payload":
        plant = replace(plant, hung=8e-3 * abs(size))
    elif effect == "base_tilt":
        plant = replace(plant, tilt=np.deg2rad(4.0) * size)
    elif effect == "time_delay":
        delay = 0.15 * abs(size)
    elif effect == "actuator_saturation":
        plant = replace(plant, limit=4.3 - 0.6 * abs(size))
    elif effect == "temperature_softening":
        plant = replace(plant, softer=0.01 * abs(size))
    folder.mkdir(parents=True)
    trials = planned(rng)
    header = ["time", "tendon_1_tension", "tendon_2_tension", "joint_1_angle", "joint_2_angle", "tip_x", "tip_y", "tip_z"]
    header += ["ambient_temperature"]
    for trial in trials:
        time = np.arange(0.0, trial.seconds + 1e-9, 1.0 / trial.rows)
        warm = 4.0 * np.sin(2 * np.pi * trial.start / 1300.0)
        q = moved(plant, trial, warm, np.maximum(time - delay, 0.0) if delay > 0.0 else time)
        true = trial.tension(time)
        reading = true * gain + bias + np.outer(trial.start + time, drift) + true @ cross.T
        seen = [
            time[:, None], reading + rng.normal(0, SIGMA["tension"], true.shape), q + rng.normal(0, SIGMA["angle"], q.shape),
            tip(plant, q) + rng.normal(0, SIGMA["tip"], (len(q), 3)), np.full((len(q), 1), 23.0 + warm),
        ]  # fmt: skip
        with (folder / f"{trial.name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows([[f"{x:.7g}" for x in row] for row in np.hstack(seen)])
    (folder / "measurements.toml").write_text(_toml(trials, effect), "utf-8")


def _toml(trials: list[Planned], effect: str | None) -> str:
    channels = [(f"tendon_{i}_tension", "input", "N", SIGMA["tension"]) for i in (1, 2)]
    channels += [(f"joint_{j}_angle", "output", "rad", SIGMA["angle"]) for j in (1, 2)]
    channels += [(f"tip_{a}", "output", "m", SIGMA["tip"]) for a in "xyz"]
    lines = ['format = "twin-measurements/1"', 'robot = "two_link"', f'title = "Two-link bench day ({effect or "as described"})"']
    lines += ['source = "simulation: Lagrange equations"', f"gravity = [0.0, 0.0, {TWO_LINK_GRAVITY}]"]
    for name, role, unit, noise in channels:
        lines += ["", "[[channel]]", f'name = "{name}"', f'role = "{role}"', f'unit = "{unit}"', f"noise = {noise:.6g}"]
    lines += ["", "[[channel]]", 'name = "ambient_temperature"', 'role = "context"', 'unit = "degC"']
    for t in trials:
        lines += ["", "[[trial]]", f'file = "{t.name}.csv"', f"start = {t.start}", f'tip_payload = "{1e3 * t.payload:g} g"']
        lines += [f"gravity = [{TWO_LINK_GRAVITY * np.sin(t.mount):.6f}, 0.0, {TWO_LINK_GRAVITY * np.cos(t.mount):.6f}]"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    out, *options = sys.argv[1:]
    given = dict(zip(options[::2], options[1::2], strict=True))
    write_day(Path(out), given.get("--effect"), int(given.get("--seed", "0")))
