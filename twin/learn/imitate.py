"""What was shown, done by tendons: a policy on shapes or on raw strains, and the controller that follows what it wants.

    wanted = policy(x),        x: the shape of all fingers, or what their cords read, tared

Policies are learned (`policy.py`: diffusion, cloning), or the nearest frame shown answers. What they want is exaggerated: shapes
tell no forces, and a finger that is wanted where it was when it touched does not press.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078) learns a diffusion policy.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from twin.errors import SolveError
from twin.learn import lerobot
from twin.learn.demonstrate import ENCODER, RESISTANCE, body_of, read_bench
from twin.learn.drifting import gains, undone
from twin.learn.hands import aligned, built, fingers
from twin.learn.kept import EVERY
from twin.learn.teach import Lesson, taught
from twin.learn.ways import WAYS, way
from twin.robots import Robot
from twin.tasks import Outcome, Task, Trial

NEAREST = "nearest"
PRESS = 0.1  # chosen, as AHEAD, on five or six trials each of seed 100: 4 of 6, at 0.2 3 of 5, the others squeezed up and out
LEARNED_PRESS = 0.05  # of a learned policy; on four trials of turn of seed 100: all; with 0.1 cylinders were turned too far
DRIFT = 0.083  # of a cord's resistance in 14 h, at most (Yoo et al. 2025)
AHEAD = 5  # frames, 0.2 s: what is followed lags by some 0.05 s, and a frame is 0.04 s


Act = Callable[[np.ndarray], np.ndarray]  # of one trial: x (d,) of every frame to what is wanted (d,)


class Policy(Protocol):
    """What was learned, by one way."""

    def begin(self, rng: np.random.Generator) -> Act: ...


class Nearest:
    """Of all frames shown that which x is nearest to, AHEAD frames later."""

    def __init__(self, episodes: Sequence[np.ndarray]) -> None:
        self.frames = np.concatenate(episodes)
        ends = np.cumsum([len(e) for e in episodes])
        last = np.repeat(ends - 1, [len(e) for e in episodes])
        later = self.frames[np.minimum(np.arange(len(self.frames)) + AHEAD, last)]
        self.wanted = pressed(later, hanging(episodes), PRESS)

    def begin(self, rng: np.random.Generator) -> Act:
        return self

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.wanted[int(np.argmin(((self.frames - x) ** 2).sum(axis=1)))]


class Learned:
    """A network's."""

    def __init__(self, lesson: Lesson, folder: Path, progress: Callable[[str], None]) -> None:
        self.net = taught(lesson, folder, progress)
        law = WAYS[lesson.way]
        self.hanging = hanging([law.shown(episode) for episode in lerobot.read_episodes(folder, law.columns)])

    def begin(self, rng: np.random.Generator) -> Act:
        from twin.learn.policy import Acting

        acting = Acting(self.net, int(rng.integers(2**31)))
        return lambda x: pressed(acting(x), self.hanging, LEARNED_PRESS)


def hanging(episodes: Sequence[np.ndarray]) -> np.ndarray:
    """x (d,) of the hand at rest."""
    return np.mean([e[0] for e in episodes], axis=0)


def pressed(wanted: np.ndarray, rest: np.ndarray, share: float) -> np.ndarray:
    """Further from rest by this share."""
    return wanted + share * (wanted - rest)


def learn(lesson: Lesson, folder: Path, progress: Callable[[str], None] = lambda words: None) -> Policy:
    """Raises as `taught`, and DataError for a folder without demonstrations."""
    if lesson.policy != NEAREST:
        return Learned(lesson, folder, progress)
    law = way(lesson.way)
    return Nearest([law.shown(episode) for episode in lerobot.read_episodes(folder, law.columns)])


@dataclass(frozen=True)
class Actor:
    """A policy that sees and moves one `way`, on the hand that seed `hand` builds, at a task. Its cords drift by up to the share
    `drift` over all trials of a score, their day; `checked`: before each trial free motion tells by what, which is undone."""

    task: Task
    robot: Robot
    hand: int
    way: str
    policy: Policy
    drift: float = 0.0
    checked: bool = False

    def act(self, rng: np.random.Generator, share: float = 0.0) -> Trial:
        """A trial to its end, at this share of the day."""
        *_, trial = self.steps(rng, share)
        return trial

    def steps(self, rng: np.random.Generator, share: float = 0.0) -> Iterator[Trial]:
        """A trial, step by step. Where the twin knows no equilibrium, tendons stay where they are."""
        values = built(self.robot, self.hand)
        with threadpool_limits(limits=1):
            hand, known = body_of(self.robot, values), aligned(self.robot, values, self.hand)
            trial = Trial(self.task, hand, self.robot.gravity, rng)
            gain = gains(self.drift, share, trial.seen.resistance.shape, self.hand)
            if self.checked:
                gain = gain / undone(hand, self.robot.gravity, fingers(self.robot, known), gain, rng)
            felt = read_bench(trial.seen.resistance, RESISTANCE, rng) * gain
            body = WAYS[self.way](self.robot, known, felt)
            act = self.policy.begin(rng)
            wanted, shortening, k = np.empty(0), trial.seen.shortening, 0
            while not trial.over:
                if k % EVERY == 0:
                    wanted = act(body.see(felt, read_bench(trial.seen.shortening, ENCODER, rng)))
                with suppress(SolveError):
                    shortening = body.follow(wanted, felt)
                trial.pull(shortening)
                felt = read_bench(trial.seen.resistance, RESISTANCE, rng) * gain
                k += 1
                yield trial

    def score(
        self, trials: int, seed: int, jobs: int, progress: Callable[[str], None] = lambda words: None,
        keep: Callable[[int, Trial], None] = lambda number, trial: None,
    ) -> Counter[Outcome]:  # fmt: skip
        """What became of `trials` fresh trials; each has its own stream, by the seed and its number, and is given to `keep`."""
        rngs = (np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, i))) for i in range(trials))
        shares = np.linspace(0.0, 1.0, trials)
        found: Counter[Outcome] = Counter()
        work = Parallel(n_jobs=jobs, prefer="threads", return_as="generator")
        for outcome in work(delayed(self._outcome)(k, r, s, keep) for k, (r, s) in enumerate(zip(rngs, shares, strict=True))):
            found[cast(Outcome, outcome)] += 1
            progress(f"{found[Outcome.SUCCESS]} of {found.total()}")
        return found

    def _outcome(self, number: int, rng: np.random.Generator, share: float, keep: Callable[[int, Trial], None]) -> Outcome:
        trial = self.act(rng, share)
        keep(number, trial)
        return trial.outcome()
