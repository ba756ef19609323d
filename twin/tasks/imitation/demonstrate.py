"""Record demonstrations by hand: a person's pushes on fingers with slack tendons, as a bench would record them.

Every attempt has its own random stream, by the seed and its number; attempts are made in order until enough have succeeded. Only
those are stored; the outcomes of all are in `meta/attempts.json`. An interrupted order resumes to the same files.
"""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError
from twin.mechanics.silicone import HandBody
from twin.robots import Robot
from twin.tasks import Demonstrator, Outcome, Task, TaskTrial
from twin.tasks.imitation import lerobot
from twin.tasks.imitation.episode_store import (
    DEMONSTRATIONS,
    FPS,
    STEPS_PER_FRAME,
    Episode,
    EpisodeInfo,
    episode_path,
    store_episode,
)
from twin.tasks.imitation.hand_model import HandShapeEstimator, draw_alignment, draw_built_hand, finger_twins

DEMONSTRATIONS_FORMAT = "twin-demonstrations/1"
ATTEMPTS_FILE = Path("meta/attempts.json")
RESISTANCE_NOISE, ENCODER_NOISE = 0.3, 1e-5  # ohm, m: noise of a reading, as in the finger's samples
MOST_ATTEMPTS_EACH = 20  # attempts for each demonstration wanted


@dataclass(frozen=True)
class DemonstrationOrder:
    """An order of `n` demonstrations of a task on the hand that `seed` builds."""

    task: Task
    robot: Robot
    n: int
    seed: int

    def manifest(self) -> dict[str, Any]:
        """Return the order as `meta/attempts.json` states it."""
        return {"format": DEMONSTRATIONS_FORMAT, "task": self.task.name(), "robot": self.robot.name, "n": self.n, "seed": self.seed}


class Attempt(NamedTuple):
    """The outcome of an attempt, its frames (every column (n, width)), and the episode for viewing."""

    outcome: Outcome
    frames: dict[str, np.ndarray]
    episode: Episode


def attempt_rng(seed: int, attempt: int) -> np.random.Generator:
    """Return the random generator of an attempt."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2, attempt)))


def hand_body(robot: Robot, values: dict[str, float]) -> HandBody:
    """Return the hand's body with these values (SI)."""
    return robot.hand(robot.build(values))


def demonstrate(
    order: DemonstrationOrder, folder: Path, jobs: int, progress: Callable[[str], None] = lambda words: None
) -> Counter[Outcome]:
    """Make the missing demonstrations of an order in `folder`, and return the outcomes of all attempts.

    Raises DataError for a folder with another order and where hardly any attempt succeeds.
    """
    outcomes = _start_or_resume(order, folder)
    values = draw_built_hand(order.robot, order.seed)
    hand_body(order.robot, values)
    while (succeeded := outcomes.count(Outcome.SUCCESS)) < order.n:
        if len(outcomes) >= MOST_ATTEMPTS_EACH * order.n:
            raise DataError(
                f"{succeeded} of {len(outcomes)} attempts at {order.task.name()!r} succeeded; it cannot be shown this way"
            )
        batch = range(len(outcomes), len(outcomes) + min(jobs, order.n - succeeded))
        attempts = cast(
            "list[Attempt]", Parallel(n_jobs=jobs, prefer="threads")(delayed(_make_attempt)(order, values, i) for i in batch)
        )
        for attempt in attempts:
            if attempt.outcome is Outcome.SUCCESS:
                index = outcomes.count(Outcome.SUCCESS)
                lerobot.write_episode(folder, index, attempt.frames, FPS)
                episode = replace(attempt.episode, info=replace(attempt.episode.info, number=index))
                store_episode(episode_path(folder, DEMONSTRATIONS, index), episode)
            outcomes.append(attempt.outcome)
            write_json(folder / ATTEMPTS_FILE, order.manifest() | {"outcomes": outcomes})
        progress(f"{outcomes.count(Outcome.SUCCESS)} of {order.n}, {len(outcomes)} attempts")
    lerobot.write_meta(folder, f"{order.task.name()}: {order.task.description}", order.robot.name, FPS)
    return Counter(outcomes)


def read_order(folder: Path) -> dict[str, Any]:
    """Read the order that a folder of demonstrations was made to. Raises DataError where it is none or incomplete."""
    try:
        order = json.loads((folder / ATTEMPTS_FILE).read_text("utf-8"))
    except (OSError, ValueError):
        raise DataError(f"{folder} holds no demonstrations; make them with twin demonstrate TASK --out {folder}") from None
    if order.get("format") != DEMONSTRATIONS_FORMAT or order["outcomes"].count(Outcome.SUCCESS) < order["n"]:
        raise DataError(f"{folder}: its demonstrations are incomplete; run the same twin demonstrate again to go on")
    return order


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, (json.dumps(content, indent=1) + "\n").encode())


def _start_or_resume(order: DemonstrationOrder, folder: Path) -> list[Outcome]:
    """Return the outcomes of earlier attempts of this order."""
    path = folder / ATTEMPTS_FILE
    if path.exists():
        try:
            existing = json.loads(path.read_text("utf-8"))
            outcomes = [Outcome(o) for o in existing.pop("outcomes")]
        except (OSError, ValueError, KeyError):
            existing, outcomes = None, []
        if existing != order.manifest():
            raise DataError(f"{folder} holds other demonstrations; give a new folder with --out, or ask for the same to go on")
        return outcomes
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(f"{folder} is there already and holds no demonstrations; give a new folder with --out")
    return []


def _make_attempt(order: DemonstrationOrder, values: dict[str, float], i: int) -> Attempt:
    """Make attempt i."""
    robot, rng = order.robot, attempt_rng(order.seed, i)
    estimator = HandShapeEstimator(finger_twins(robot, draw_alignment(robot, values, order.seed)))
    with threadpool_limits(limits=1):
        trial = TaskTrial(order.task, hand_body(robot, values), robot.gravity, rng)
        demonstrator = Demonstrator.draw(rng, len(trial.start.nodes), order.task.push_strength)
        rows: dict[str, list[np.ndarray]] = {name: [] for name in ("resistance", "encoder", "state", "object")}
        k = 0
        while not trial.is_over:
            if k % STEPS_PER_FRAME == 0:
                observed = trial.state
                readings = add_noise(observed.resistance, RESISTANCE_NOISE, rng), add_noise(observed.shortening, ENCODER_NOISE, rng)
                pose = np.concatenate([observed.place[0], observed.turn[0]])
                for name, value in zip(rows, (*readings, estimator.estimate(*readings), pose), strict=True):
                    rows[name].append(value.ravel())
            trial.push(demonstrator)
            k += 1
    state = np.stack(rows["state"])
    action = np.vstack([np.diff(state, axis=0), np.zeros((1, state.shape[1]))])
    columns = {f"observation.{name}": np.stack(rows[name]) for name in ("state", "resistance", "encoder")}
    columns |= {"action": action, "object.pose": np.stack(rows["object"])}
    info = EpisodeInfo(order.task.name(), robot.name, order.seed, DEMONSTRATIONS, i)
    return Attempt(trial.outcome(), columns, Episode.of(trial, info))


def add_noise(true: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    """Return a reading of the true value."""
    return true + noise * rng.normal(size=true.shape)
