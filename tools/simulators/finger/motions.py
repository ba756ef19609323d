"""What the drives are told on a bench day: sweeps of one tendon, antagonistic pairs, a circle, holds, wanders; mm, s.

Every trial begins at rest with all tendons just taut. A tendon that shall not pull is paid out by PAID_OUT.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

PAID_OUT, PAID_OUT_FAR = -6.0, -15.0  # mm, slack in tendon trials and where only the hand moves the finger
REST_BEFORE, REST_BEFORE_HAND = 0.5, 0.2  # s
PAUSE = 60.0  # s between two trials
AZIMUTH = np.deg2rad([0.0, 90.0, 180.0, 270.0])


@dataclass(frozen=True)
class Trial:
    name: str
    time: np.ndarray  # (n,) s, of the rows
    command: np.ndarray  # (n, 4) mm
    start: float = 0.0  # s on the day's clock
    frames: float = 2.0  # s between two clouds
    cloud: bool = True
    hand: bool = False
    edges: bool = False  # in place of a hand
    heldout: bool = False


Times = np.ndarray | float


def ease(t: Times, begin: Times, end: Times) -> np.ndarray:
    """From 0 to 1 between two times, a half cosine."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip((t - begin) / (end - begin), 0.0, 1.0))


def bump(t: Times, begin: Times, end: Times) -> np.ndarray:
    """0, 1 in the middle, 0: sine squared."""
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.clip((t - begin) / (end - begin), 0.0, 1.0))


def rows(duration: float, rate: float) -> np.ndarray:
    time = np.arange(0.0, duration + 1e-9, 1 / rate)
    return np.round(time if duration - time[-1] < 1e-6 else np.append(time, duration), 4)


def _alone(t: np.ndarray, tendon: int, pull: np.ndarray) -> np.ndarray:
    command = np.tile(PAID_OUT * ease(t, REST_BEFORE, REST_BEFORE + 1.0)[:, None], (1, 4))
    command[:, tendon] = pull
    return command


def sweep(rng: np.random.Generator, tendon: int) -> Trial:
    t = rows(15.0, 10)
    top = rng.uniform(7.8, 9.2)
    pull = top * (bump(t, 1.5, 8.0) + rng.uniform(0.45, 0.75) * bump(t, 8.0, 14.0))
    return Trial(f"sweep_{tendon + 1}", t, _alone(t, tendon, pull))


def pair(rng: np.random.Generator, tendon: int) -> Trial:
    t = rows(19.0, 2.5)
    tight, swing = rng.uniform(1.2, 2.2), rng.uniform(6.0, 7.0)
    command = np.tile(tight * (ease(t, REST_BEFORE, 2.0) - ease(t, 16.4, 18.0))[:, None], (1, 4))
    wave = swing * np.sin(2 * np.pi * np.clip(t - 2.0, 0, 14.0) / 14.0) * ease(t, 2.0, 4.0)
    command[:, tendon] += wave
    command[:, tendon + 2] -= wave
    return Trial(f"pair_{tendon + 1}{tendon + 3}", t, command)


def circle(rng: np.random.Generator) -> Trial:
    t = rows(22.0, 2.5)
    phase = 2 * np.pi * (t[:, None] - REST_BEFORE) / 10.0 - AZIMUTH
    window = ease(t, REST_BEFORE, 2.5) - ease(t, 18.5, 21.0)
    return Trial("circle", t, (1.0 + rng.uniform(6.2, 6.8) * np.cos(phase)) * window[:, None])


def hold(rng: np.random.Generator, number: int, tendon: int, until: float, duration: float) -> Trial:
    t = rows(duration, 10)
    pull = rng.uniform(6.5, 8.8) * (ease(t, 1.5, 3.0) - ease(t, until, until + 1.0))
    return Trial(f"hold_{number}", t, _alone(t, tendon, pull), heldout=number > 1)


def wander(rng: np.random.Generator, name: str, duration: float, rate: float, rest: float, most: float) -> Trial:
    """Two bending directions and the common pull, each a sum of three slow waves; the largest pull is `most` mm."""
    t = rows(duration, rate)

    def waves(size: float) -> np.ndarray:
        periods, phases = rng.uniform(4.0, 14.0, 3), rng.uniform(0, 2 * np.pi, 3)
        return size * np.sum(rng.uniform(0.4, 1.0, (3, 1)) * np.sin(2 * np.pi * t / periods[:, None] + phases[:, None]), axis=0)

    x, y, common = waves(1.0), waves(1.0), 1.5 + waves(0.2)
    command = np.stack([x, y, -x, -y], axis=1)
    command = command * (most - 1.5) / np.abs(command).max() + common[:, None]
    return Trial(name, t, command * ease(t, rest, rest + 2.0)[:, None])


def paid_out(name: str, duration: float) -> Trial:
    """All tendons slack, the hand alone moves the finger."""
    t = rows(duration, 10)
    return Trial(name, t, np.tile(PAID_OUT_FAR * ease(t, REST_BEFORE_HAND, REST_BEFORE_HAND + 1.0)[:, None], (1, 4)), hand=True)


def clocked(trials: list[Trial], change: Callable[[Trial], dict]) -> list[Trial]:
    """The trials with their starts, PAUSE apart, and what `change` adds."""
    start, day = 0.0, []
    for trial in trials:
        day.append(Trial(**{**trial.__dict__, "start": start, **change(trial)}))
        start += float(trial.time[-1]) + PAUSE
    return day


def bench_day(rng: np.random.Generator) -> list[Trial]:
    """Eight trials to learn from and three held out."""
    trials = [sweep(rng, i) for i in range(4)] + [pair(rng, 0), pair(rng, 1), circle(rng)]
    first, second = rng.permutation(4)[:2]
    trials.append(hold(rng, 1, int(first), 14.0, 24.0))
    trials += [wander(rng, f"wander_{n}", 20.0, 2.5, REST_BEFORE, rng.uniform(6.0, 8.3)) for n in (1, 2)]
    trials.append(hold(rng, 2, int(second), 10.0, 18.0))
    return clocked(trials, lambda trial: {"heldout": trial.heldout or trial.name.startswith("wander")})


def shape_day(rng: np.random.Generator) -> list[Trial]:
    """Two trials with clouds to align by, three without; by tendons, by hand, and by both."""
    trials = [
        wander(rng, "align_1", 16.0, 10, REST_BEFORE_HAND, rng.uniform(8.5, 9.4)),
        paid_out("align_2", 16.0),
        wander(rng, "test_1", 14.0, 10, REST_BEFORE_HAND, rng.uniform(8.0, 9.4)),
        paid_out("test_2", 18.0),
        wander(rng, "test_3", 16.0, 10, REST_BEFORE_HAND, rng.uniform(5.0, 7.0)),
    ]
    return clocked(trials, lambda t: {"frames": 0.5, "cloud": t.name.startswith("align"), "hand": t.hand or t.name == "test_3"})
