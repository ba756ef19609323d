"""A bench day: which trials are run, in which order, with which loads and commanded tensions.

The default holds what a diagnosis needs: slow and fast pulls in three directions with inner loops, pulls of two tendons,
random combined pulls, steps of 0.45 s, holds of more than 60 s, payloads of 0, 10 and 20 g, a circle repeated four times
through the day, all in random order. The poor designs each leave one of these out; by_length commands displacements; by_current
heats springs, each alone, in pairs and in turns, with pauses in which they cool.
"""

from dataclasses import dataclass, replace

import numpy as np

from tools.simulators.rod.mechanics.rod import Rod, follow

POOR = ("no_repeats", "time_ordered", "loading_only", "one_payload", "one_rate", "one_tendon", "tip_only")
BENCH_DESIGNS = ("default", "hanging", "sideways", "mixed", *POOR, "by_length", "by_current")
BENCH_TENDONS = 3
FINE_RATE = 50.0  # Hz of the fine command
FASTEST_STEP = 0.45  # s, the fastest step


@dataclass(frozen=True)
class Trial:
    name: str
    payload: float  # kg, declared
    time: np.ndarray  # (n,) s, of the log's rows
    fine: np.ndarray  # (m,) s
    command: np.ndarray  # (m, T) at the fine times, linear in between: base tension in N, displacement in m, or current in A
    start: float = 0.0  # s on the common clock
    gravity: tuple[float, float, float] | None = None  # overrides the day's


@dataclass(frozen=True)
class Day:
    trials: tuple[Trial, ...]  # by the clock
    gravity: tuple[float, float, float]
    room: np.ndarray  # (2, k): clock (s) and ambient temperature (degC), linear in between
    tip_only: bool = False
    driven_by_length: bool = False  # the motors command tendon displacements
    driven_by_current: bool = False  # currents heat SMA springs

    def ambient(self, clock: np.ndarray) -> np.ndarray:
        return np.interp(clock, self.room[0], self.room[1])


def _pull(rng: np.random.Generator, tendons: list[int], top: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Up, an inner loop, up again, down with an inner loop, to rest: the same in all `tendons`, a little out of step."""
    shape = np.array([0.0, 0.75, 0.35, 1.0, 0.55, 0.8, 0.2, 0.45, 0.0])
    when = np.linspace(0.0, duration, len(shape))
    level = np.tile(rng.uniform(0.0, 0.2, BENCH_TENDONS), (len(shape), 1))
    for i in tendons:
        wobble = shape + (shape > 0) * (shape < 1) * rng.uniform(-0.1, 0.1, len(shape))
        level[:, i] = top * wobble * rng.uniform(0.8, 1.0)
    return when, level


def _wander(rng: np.random.Generator, top: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    when = np.linspace(0.0, duration, 11)
    level = top * rng.uniform(0.0, 1.0, (11, BENCH_TENDONS)) * rng.choice([0.15, 0.6, 0.9], (11, BENCH_TENDONS))
    return when, level


def _steps(rng: np.random.Generator, top: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    count = 9
    pulled = rng.integers(0, BENCH_TENDONS, count)
    level = np.full((count, BENCH_TENDONS), 0.1)
    level[np.arange(count), pulled] = top * rng.uniform(0.2, 1.0, count)
    return _plateaus(np.linspace(0.0, duration, count + 1)[:-1], level, duration)


def _hold(rng: np.random.Generator, tendon: int, top: float) -> tuple[np.ndarray, np.ndarray]:
    level = np.full((3, BENCH_TENDONS), 0.1)
    level[1, tendon] = top * rng.uniform(0.75, 1.0)
    level[2, tendon] = 0.3
    level[1:, (tendon + 1) % BENCH_TENDONS] = rng.uniform(0.0, 0.5)
    return _plateaus(np.array([0.0, 3.0, 73.0]), level, 103.0)


def _plateaus(begin: np.ndarray, level: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray]:
    when = np.append(np.stack([begin[1:], begin[1:] + FASTEST_STEP], axis=1).ravel(), duration)
    return np.append(0.0, when), np.repeat(level, 2, axis=0)


def _circle(top: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    when = np.linspace(0.0, duration, 61)
    around = 3 * np.pi * when[:, None] / duration - 2 * np.pi * np.arange(BENCH_TENDONS) / BENCH_TENDONS
    return when, top * (0.5 + 0.5 * np.cos(around))


def _trial(rng: np.random.Generator, name: str, payload: float, when: np.ndarray, level: np.ndarray, smooth: bool) -> Trial:
    duration = when[-1]
    fine = np.linspace(0.0, duration, int(np.ceil(duration * FINE_RATE)) + 1)
    if smooth:  # half a cosine from one level to the next: every level is a reversal at rest
        k = np.clip(np.searchsorted(when, fine, side="right") - 1, 0, len(when) - 2)
        x = 0.5 - 0.5 * np.cos(np.pi * (fine - when[k]) / (when[k + 1] - when[k]))
        command = level[k] + x[:, None] * (level[k + 1] - level[k])
    else:
        command = np.stack([np.interp(fine, when, level[:, i]) for i in range(BENCH_TENDONS)], axis=1)
    rows = int(rng.integers(70, 86))
    time = np.linspace(0.0, duration, rows)
    time[1:-1] += rng.uniform(-0.15, 0.15, rows - 2) * duration / (rows - 1)
    return Trial(name, payload, np.round(time, 4), fine, np.maximum(command, 0.0))


def bench_day(design: str, rng: np.random.Generator) -> Day:
    """Draw a day after one of BENCH_DESIGNS."""
    if design not in BENCH_DESIGNS:
        raise ValueError(f"design {design!r} is not one of {', '.join(BENCH_DESIGNS)}")
    hanging = design in ("hanging", "mixed") or (design != "sideways" and rng.random() < 0.5)
    sign, axis = rng.choice([-1.0, 1.0]), rng.integers(2)
    sideways = tuple(float(g) for g in 9.81 * sign * np.eye(3)[axis])
    top = rng.uniform(3.0, 3.9)
    slow, fast = (60.0, 60.0) if design == "one_rate" else (80.0, 9.0)
    if design == "by_current":
        return _schedule(design, rng, *_heatings(rng), 3, (0.0, 0.0, 9.81) if hanging else sideways, sideways)
    trials = []
    for i in range(BENCH_TENDONS):
        trials += [
            _trial(rng, f"slow_{i + 1}", 0.0, *_pull(rng, [i], top, slow), True),
            _trial(rng, f"fast_{i + 1}", 0.0, *_pull(rng, [i], top, fast), True),
            _trial(rng, f"pair_{i + 1}", 0.01, *_pull(rng, [i, (i + 1) % 3], 0.8 * top, slow / 2), True),
            _trial(rng, f"hold_{i + 1}", 0.01 * i, *_hold(rng, i, top), False),
        ]
    for n, payload in enumerate((0.0, 0.01, 0.02, 0.0)):
        trials.append(_trial(rng, f"wander_{n + 1}", payload, *_wander(rng, top, fast if n == 3 else slow / 1.5), True))
    for n, payload in enumerate((0.0, 0.01, 0.02)):
        duration = 60.0 if design == "one_rate" else (14.0, 30.0, 30.0)[n]
        trials.append(_trial(rng, f"steps_{n + 1}", payload, *_steps(rng, top, duration), design == "one_rate"))
    trials.append(_trial(rng, "circle_payload20", 0.02, *_circle(0.8 * top, slow / 2), False))
    circle = _trial(rng, "circle", 0.01, *_circle(0.85 * top, slow / 2), False)
    repeats = 1 if design == "no_repeats" else 4
    if design == "one_tendon":
        trials = [t for t in trials if t.name in ("slow_1", "fast_1", "hold_1")]
        trials += [_trial(rng, f"pull_{n}", 0.01 * (n % 3), *_pull(rng, [0], top, slow), True) for n in range(1, 18)]
        circle = replace(trials[0], name="repeat")
    return _schedule(design, rng, trials, circle, repeats, (0.0, 0.0, 9.81) if hanging else sideways, sideways)


def _heatings(rng: np.random.Generator) -> tuple[list[Trial], Trial]:
    """Trials of some two minutes in currents, and the one that is repeated."""

    def trial(name: str, payload: float, level: np.ndarray, duration: float) -> Trial:
        return _trial(rng, name, payload, *_plateaus(np.linspace(0.0, duration, len(level) + 1)[:-1], level, duration), False)

    trials = []
    for i in range(BENCH_TENDONS):
        alone, pair = np.zeros((6, BENCH_TENDONS)), np.zeros((6, BENCH_TENDONS))
        alone[:, i] = rng.uniform(1.1, 1.3) * np.array([1.0, 0.6, 1.0, 0.0, 1.05, 0.0])
        pair[[0, 1, 3], i] = rng.uniform(0.9, 1.3, 3)
        pair[[1, 2, 4], (i + 1) % BENCH_TENDONS] = rng.uniform(0.9, 1.3, 3)
        trials += [trial(f"heat_{i + 1}", 0.0, alone, 120.0), trial(f"pair_{i + 1}", 0.01 * (i % 3), pair, 120.0)]
    for n, payload in enumerate((0.0, 0.01, 0.02, 0.0, 0.01)):
        level = rng.uniform(0.7, 1.4, (7, BENCH_TENDONS)) * (rng.random((7, BENCH_TENDONS)) < 0.5)
        trials.append(trial(f"wander_{n + 1}", payload, level, 140.0))
    turns = 1.25 * np.eye(BENCH_TENDONS)[np.arange(6) % BENCH_TENDONS]
    return trials, trial("turns", 0.01, turns, 120.0)


def _schedule(
    design: str,
    rng: np.random.Generator,
    trials: list[Trial],
    repeated: Trial,
    repeats: int,
    gravity: tuple[float, float, float],
    sideways: tuple[float, float, float],
) -> Day:
    """Order, clock, gravity and the poor designs' omissions."""
    order = list(trials) if design == "time_ordered" else [trials[n] for n in rng.permutation(len(trials))]
    spread = np.linspace(0, len(order), repeats).round().astype(int) if repeats > 1 else np.array([len(order) // 2])
    for n in range(repeats - 1, -1, -1):
        order.insert(int(spread[n]), replace(repeated, name=f"{repeated.name}_{n + 1}"))
    if design == "loading_only":
        order = [replace(t, command=np.sort(t.command, axis=0)) for t in order]
    if design == "one_payload":
        order = [replace(t, payload=0.0) for t in order]
    if design == "mixed":
        turn = [None, sideways, (0.0, 0.0, -9.81)]
        order = [
            t if t.name.startswith(repeated.name) or t.payload > 0.01 else replace(t, gravity=turn[int(rng.integers(3))])
            for t in order
        ]
    clock, timed = 0.0, []
    for t in order:
        timed.append(replace(t, start=round(clock, 1)))
        clock += t.time[-1] + rng.uniform(15.0, 90.0)
    knots = np.linspace(0.0, clock, 9)
    room = np.stack([knots, 23.0 + rng.uniform(-2.0, 2.0) + rng.uniform(-4.0, 4.0, len(knots))])
    if design == "by_length":
        timed = [_in_displacements(t, gravity) for t in timed]
    return Day(tuple(timed), gravity, room, design == "tip_only", design == "by_length", design == "by_current")


def _in_displacements(trial: Trial, gravity: tuple[float, float, float]) -> Trial:
    """The same motion commanded by length, as somebody would plan it with the described robot.

    Three taut inextensible tendons would fight each other over fractions of a millimetre, so the weakest is always left
    slack by 2 mm and the others are taut as soon as they are to pull.
    """
    nodes = np.linspace(trial.fine[0], trial.fine[-1], min(len(trial.fine), 241))
    tension = np.stack([np.interp(nodes, trial.fine, c) for c in trial.command.T], axis=1)
    tension -= tension.min(axis=1, keepdims=True)
    lead = np.arange(1, 17)[:, None] / 16
    shape = follow(
        Rod(),
        np.vstack([lead * tension[0], tension]),
        gravity=trial.gravity or gravity,
        payload=trial.payload,
        weight=np.append(lead, np.ones(len(tension))),
        nodes=2,
    )
    displacement = shape.displacement[len(lead) :] - 2e-3 * np.exp(-tension / 0.15)
    return replace(trial, fine=nodes, command=displacement)
