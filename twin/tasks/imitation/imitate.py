"""Run policies learned from demonstrations by tendons: a policy on shapes or raw strains, and a controller that follows it.

    wanted = policy(x),        x: the shape of all fingers, or their cords' readings, tared

Policies are networks (`policy.py`: diffusion, cloning), or the nearest demonstrated frame. Their output is exaggerated: shapes
carry no forces, and a finger at its demonstrated contact position does not press.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078) learns a diffusion policy.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from twin.foundation.errors import SolveError
from twin.robots import Robot
from twin.tasks import Outcome, Task, TaskTrial
from twin.tasks.imitation import lerobot
from twin.tasks.imitation.demonstrate import ENCODER_NOISE, RESISTANCE_NOISE, add_noise, hand_body
from twin.tasks.imitation.episode_store import STEPS_PER_FRAME
from twin.tasks.imitation.hand_model import draw_alignment, draw_built_hand, finger_twins
from twin.tasks.imitation.policy_training import PolicyTrainingSpec, train_or_load
from twin.tasks.imitation.representations import REPRESENTATIONS, representation_class
from twin.tasks.imitation.sensor_drift import drift_gains, estimate_drift_gains

NEAREST_POLICY = "nearest"
# fraction of the way from rest; chosen, as FRAMES_LATER, on six trials: at 0.2 objects were squeezed out
NEAREST_EXAGGERATION = 0.1
NETWORK_EXAGGERATION = 0.05  # of a network; chosen on four trials of `turn`: with 0.1 cylinders were turned too far
LARGEST_DRIFT = 0.083  # of a cord's resistance in 14 h, at most (Yoo et al. 2025)
FRAMES_LATER = 5  # 0.2 s: the fingers lag by some 0.05 s, and a frame is 0.04 s


ActFunction = Callable[[np.ndarray], np.ndarray]  # of one trial: x (d,) of every frame to the wanted x (d,)


class TrialPolicy(Protocol):
    """A policy for one representation."""

    def start_trial(self, rng: np.random.Generator) -> ActFunction: ...


class NearestFramePolicy:
    """The demonstrated frame nearest to x, FRAMES_LATER frames later."""

    def __init__(self, episodes: Sequence[np.ndarray]) -> None:
        self.frames = np.concatenate(episodes)
        ends = np.cumsum([len(e) for e in episodes])
        last = np.repeat(ends - 1, [len(e) for e in episodes])
        later = self.frames[np.minimum(np.arange(len(self.frames)) + FRAMES_LATER, last)]
        self.targets = exaggerate(later, mean_start(episodes), NEAREST_EXAGGERATION)

    def start_trial(self, rng: np.random.Generator) -> ActFunction:
        """Return the policy itself, which keeps nothing of a trial."""
        return self

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return the wanted x (d,) for x (d,)."""
        return self.targets[int(np.argmin(((self.frames - x) ** 2).sum(axis=1)))]


class NetworkPolicy:
    """The policy of a trained network."""

    def __init__(self, spec: PolicyTrainingSpec, folder: Path, progress: Callable[[str], None]) -> None:
        self.network = train_or_load(spec, folder, progress)
        representation = REPRESENTATIONS[spec.way]
        self.hanging = mean_start(
            [representation.from_demonstration(episode) for episode in lerobot.read_episodes(folder, representation.columns)]
        )

    def start_trial(self, rng: np.random.Generator) -> ActFunction:
        """Return the function that acts in one trial, with its own random numbers."""
        from twin.tasks.imitation.policy import PolicyExecutor

        executor = PolicyExecutor(self.network, int(rng.integers(2**31)))
        return lambda x: exaggerate(executor(x), self.hanging, NETWORK_EXAGGERATION)


def mean_start(episodes: Sequence[np.ndarray]) -> np.ndarray:
    """Return x (d,) of the hand at rest, the mean first frame."""
    return np.mean([e[0] for e in episodes], axis=0)


def exaggerate(wanted: np.ndarray, rest: np.ndarray, share: float) -> np.ndarray:
    """Return `wanted` further from rest by this fraction."""
    return wanted + share * (wanted - rest)


def make_policy(spec: PolicyTrainingSpec, folder: Path, progress: Callable[[str], None] = lambda words: None) -> TrialPolicy:
    """Make the policy of a training spec. Raises as `train_or_load`, and DataError for a folder without demonstrations."""
    if spec.policy != NEAREST_POLICY:
        return NetworkPolicy(spec, folder, progress)
    representation = representation_class(spec.way)
    return NearestFramePolicy(
        [representation.from_demonstration(episode) for episode in lerobot.read_episodes(folder, representation.columns)]
    )


@dataclass(frozen=True)
class PolicyRunner:
    """Runs a policy on the hand that seed `hand` builds, with one representation, at a task.

    Its cords drift by up to the fraction `drift` over all trials of a score, their day; `checked`: free motion before each trial
    estimates the drift, which is corrected.
    """

    task: Task
    robot: Robot
    hand: int
    representation: str
    policy: TrialPolicy
    drift: float = 0.0
    checked: bool = False

    def run_trial(self, rng: np.random.Generator, share: float = 0.0) -> TaskTrial:
        """Run a trial to its end, at this share of the day."""
        *_, trial = self.trial_steps(rng, share)
        return trial

    def trial_steps(self, rng: np.random.Generator, share: float = 0.0) -> Iterator[TaskTrial]:
        """Run a trial step by step. Where the twin has no equilibrium, tendons stay where they are."""
        values = draw_built_hand(self.robot, self.hand)
        with threadpool_limits(limits=1):
            hand, known = hand_body(self.robot, values), draw_alignment(self.robot, values, self.hand)
            trial = TaskTrial(self.task, hand, self.robot.gravity, rng)
            gain = drift_gains(self.drift, share, trial.state.resistance.shape, self.hand)
            if self.checked:
                gain = gain / estimate_drift_gains(hand, self.robot.gravity, finger_twins(self.robot, known), gain, rng)
            resistance = add_noise(trial.state.resistance, RESISTANCE_NOISE, rng) * gain
            representation = REPRESENTATIONS[self.representation](self.robot, known, resistance)
            act = self.policy.start_trial(rng)
            wanted, shortening, k = np.empty(0), trial.state.shortening, 0
            while not trial.is_over:
                if k % STEPS_PER_FRAME == 0:
                    wanted = act(representation.observe(resistance, add_noise(trial.state.shortening, ENCODER_NOISE, rng)))
                with suppress(SolveError):
                    shortening = representation.track(wanted, resistance)
                trial.pull(shortening)
                resistance = add_noise(trial.state.resistance, RESISTANCE_NOISE, rng) * gain
                k += 1
                yield trial

    def score(
        self, trials: int, seed: int, jobs: int, progress: Callable[[str], None] = lambda words: None,
        keep: Callable[[int, TaskTrial], None] = lambda number, trial: None,
    ) -> Counter[Outcome]:  # fmt: skip
        """Return the outcomes of `trials` fresh trials.

        Each trial has its own random stream, by the seed and its number, and is passed to `keep`.
        """
        rngs = (np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, i))) for i in range(trials))
        shares = np.linspace(0.0, 1.0, trials)
        outcomes: Counter[Outcome] = Counter()
        work = Parallel(n_jobs=jobs, prefer="threads", return_as="generator")
        for outcome in work(delayed(self._outcome)(k, r, s, keep) for k, (r, s) in enumerate(zip(rngs, shares, strict=True))):
            outcomes[cast(Outcome, outcome)] += 1
            progress(f"{outcomes[Outcome.SUCCESS]} of {outcomes.total()}")
        return outcomes

    def _outcome(self, number: int, rng: np.random.Generator, share: float, keep: Callable[[int, TaskTrial], None]) -> Outcome:
        """Run one trial and return its outcome."""
        trial = self.run_trial(rng, share)
        keep(number, trial)
        return trial.outcome()
