"""What was shown, done by tendons: a policy on shapes or on raw strains, and the controller that follows what it wants.

    wanted = policy(x),        x: the shape of all fingers, or what their cords read, tared; wanted: the same, AHEAD frames later

A person's hand pushes where no tendon pulls; what is learned is therefore where the fingers were, not what moved them, and the
controllers of `twin/control` find the shortenings. The same is done with strains: x = sqrt(R/R_0) - 1 of all cords, R_0 what they
read while the hand hung before the trial, followed by strain tracking with the twin as described. A shape is estimated with the
twin as an alignment knows it, strains need none; that is the difference in what the two are told.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078) learns a diffusion policy; here the nearest frame shown answers.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from twin.control.shape import ShapeController
from twin.control.shape_baselines import BendTracking, StrainTracking
from twin.errors import SolveError, UnknownNameError
from twin.learn import lerobot
from twin.learn.demonstrate import ENCODER, EVERY, RESISTANCE, body_of, read_bench
from twin.learn.hands import Eye, aligned, built, fingers
from twin.robots import Robot
from twin.tasks import STEP, Outcome, Task, Trial

CORDS = 4  # of a finger
PRESS = 0.1  # chosen, as AHEAD, on five or six trials each of seed 100: 4 of 6, at 0.2 3 of 5, the others squeezed up and out
AHEAD = 5  # frames, 0.2 s: what is followed lags by some 0.05 s, and a frame is 0.04 s


class Way(ABC):
    """How a hand is seen and moved. One is made for a trial."""

    columns: tuple[str, ...]

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        """`known`: the hand's values by an alignment; `hanging` (f, s) ohm: what the cords read before the trial."""
        self.hanging = hanging

    @staticmethod
    @abstractmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        """x (n, d) of a demonstration's columns."""

    @abstractmethod
    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        """x (d,) of what cords (f, s) ohm and encoders (f, t) m read."""

    @abstractmethod
    def follow(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        """Shortenings (f, t) m for the next STEP s, towards x (d,)."""


class ByShape(Way):
    columns = ("observation.state",)

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        super().__init__(robot, known, hanging)
        twins = fingers(robot, known)
        self.eye, self.controllers = Eye(twins), [ShapeController(twin) for twin in twins]

    @staticmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        return episode["observation.state"]

    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return self.eye.look(resistance, shortening).ravel()

    def follow(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        points = self.eye.points(wanted.reshape(len(self.controllers), -1))
        each = zip(self.controllers, points, resistance, strict=True)
        return np.stack([controller.step(p, r, STEP).shortening for controller, p, r in each])


class ByStrain(Way):
    columns = ("observation.resistance",)
    tracking = StrainTracking

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        super().__init__(robot, known, hanging)
        self.controllers = [self.tracking(twin) for twin in fingers(robot, {})]
        self.rest = np.stack([c.finger.strain() for c in self.controllers])

    @staticmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        R = episode["observation.resistance"]
        return np.sqrt(R / R[0]) - 1.0

    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return (np.sqrt(resistance / self.hanging) - 1.0).ravel()

    def follow(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        now = self.rest + np.sqrt(resistance / self.hanging) - 1.0
        goal = self.rest + wanted.reshape(self.rest.shape)
        each = zip(self.controllers, goal, now, strict=True)
        return np.stack([c.step(g, c.cords.rest * (1.0 + x) ** 2, STEP).shortening for c, g, x in each])


class ByBend(ByStrain):
    """By what opposite cords of a finger differ by, alone: tendons compress a finger, a person's hand does not. x is that
    difference, half of it in the one cord and half in the other."""

    tracking = BendTracking

    @staticmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        return _opposed(ByStrain.shown(episode))

    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return _opposed(super().see(resistance, shortening))


def _opposed(x: np.ndarray) -> np.ndarray:
    """x (..., f s) of fingers with CORDS cords each, the second half opposite to the first."""
    cords = x.reshape(*x.shape[:-1], -1, 2, CORDS // 2)
    return 0.5 * (cords - cords[..., ::-1, :]).reshape(x.shape)


WAYS: dict[str, type[Way]] = {"shape": ByShape, "strain": ByStrain, "bend": ByBend}


class Nearest:
    """Of all frames shown that which x is nearest to, AHEAD frames later, exaggerated by PRESS: shapes tell no forces, and a finger
    that is wanted where it was when it touched does not press."""

    def __init__(self, episodes: Sequence[np.ndarray]) -> None:
        self.frames = np.concatenate(episodes)
        ends = np.cumsum([len(e) for e in episodes])
        last = np.repeat(ends - 1, [len(e) for e in episodes])
        later = self.frames[np.minimum(np.arange(len(self.frames)) + AHEAD, last)]
        hanging = np.mean([e[0] for e in episodes], axis=0)
        self.wanted = later + PRESS * (later - hanging)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.wanted[int(np.argmin(((self.frames - x) ** 2).sum(axis=1)))]


def learn(way: str, folder: Path) -> Nearest:
    """Raises UnknownNameError for another way than shape, strain and bend, DataError for a folder without demonstrations."""
    if way not in WAYS:
        raise UnknownNameError("way", way, list(WAYS))
    return Nearest([WAYS[way].shown(episode) for episode in lerobot.read_episodes(folder, WAYS[way].columns)])


@dataclass(frozen=True)
class Actor:
    """A policy that sees and moves one `way`, on the hand that seed `hand` builds, at a task."""

    task: Task
    robot: Robot
    hand: int
    way: str
    policy: Callable[[np.ndarray], np.ndarray]

    def act(self, rng: np.random.Generator) -> Trial:
        """A trial to its end. Where the twin knows no equilibrium, tendons stay where they are."""
        values = built(self.robot, self.hand)
        with threadpool_limits(limits=1):
            trial = Trial(self.task, body_of(self.robot, values), self.robot.gravity, rng)
            felt = read_bench(trial.seen.resistance, RESISTANCE, rng)
            body = WAYS[self.way](self.robot, aligned(self.robot, values, self.hand), felt)
            wanted, shortening, k = np.empty(0), trial.seen.shortening, 0
            while not trial.over:
                if k % EVERY == 0:
                    wanted = self.policy(body.see(felt, read_bench(trial.seen.shortening, ENCODER, rng)))
                with suppress(SolveError):
                    shortening = body.follow(wanted, felt)
                trial.pull(shortening)
                felt = read_bench(trial.seen.resistance, RESISTANCE, rng)
                k += 1
        return trial

    def score(
        self, trials: int, seed: int, jobs: int, progress: Callable[[str], None] = lambda words: None
    ) -> Counter[Outcome]:  # fmt: skip
        """What became of `trials` fresh trials; each has its own stream, by the seed and its number."""
        rngs = (np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, i))) for i in range(trials))
        found: Counter[Outcome] = Counter()
        for outcome in Parallel(n_jobs=jobs, prefer="threads", return_as="generator")(delayed(self._outcome)(r) for r in rngs):
            found[cast(Outcome, outcome)] += 1
            progress(f"{found[Outcome.SUCCESS]} of {found.total()}")
        return found

    def _outcome(self, rng: np.random.Generator) -> Outcome:
        return self.act(rng).outcome()
