"""Store trials for viewing: where the silicone and the things were, 25 frames a second.

    DATA/trials/shown/000.parquet                           demonstrations, by number
    DATA/trials/diffusion-0-shape-hand1-seed0/007.parquet   trials of a policy, by number
    DATA/trials/*/provenance.json                           command, seed, hash of the demonstrations, versions, date

A row a frame: time (s), nodes' displacements (finger, n_free, 3) m, tensions (finger, tendon) N, place (thing, 3) m and turn
(thing, 4) w x y z of all things, in single precision; the things and the outcome stand in the file's metadata. Trials are stored,
not simulated again: 3 s take 0.21 MB and 0.1 s to read and draw, a new simulation 2 s by hand and 4 s by tendons; and the end of a
grasp can depend on the last bit, which differs between processors.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from twin.foundation.errors import DataError
from twin.mechanics.silicone.motion.scene import Part, Thing
from twin.tasks import TABLE_NAME, Outcome, TaskTrial
from twin.tasks.imitation.lerobot import column_array, fixed_lists, write_table

EPISODE_FORMAT = "twin-trial/1"
EPISODES_FOLDER, DEMONSTRATIONS = "trials", "shown"  # folder of all sets; name of the persons' set
STEPS_PER_FRAME, FPS = 2, 25  # and frames a second
EPISODE_COLUMNS = ("time", "nodes", "tension", "place", "turn")


@dataclass(frozen=True)
class EpisodeInfo:
    """What a trial was: the task, the robot, the seed that built the hand, who performed it, and its number."""

    task: str
    robot: str
    hand: int
    who: str
    number: int


@dataclass(frozen=True)
class Episode:
    """A stored trial: what it was, its outcome and its things.

    `time` (n,) s, `nodes` (n, f, k, 3) m, `tension` (n, f, t) N; place (n, thing, 3) m and turn (n, thing, 4) of all things, fixed
    ones too.
    """

    info: EpisodeInfo
    outcome: Outcome
    things: tuple[Thing, ...]
    time: np.ndarray
    nodes: np.ndarray
    tension: np.ndarray
    place: np.ndarray
    turn: np.ndarray

    @staticmethod
    def of(trial: TaskTrial, info: EpisodeInfo) -> Episode:
        """Return the episode of a finished trial."""
        frames = trial.frames(STEPS_PER_FRAME)
        poses = [_poses(trial.things, sight.place, sight.turn, sunk) for sight, sunk in frames]
        place, turn = (np.stack(column) for column in zip(*poses, strict=True))
        states = [sight for sight, _ in frames]
        return Episode(
            info, trial.outcome(), trial.things, np.array([s.time for s in states]), np.stack([s.nodes for s in states]),
            np.stack([s.tension for s in states]), place, turn,
        )  # fmt: skip


def _poses(
    things: tuple[Thing, ...], place: np.ndarray, turn: np.ndarray, sunk: float
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return places and turns of all things; `place` and `turn` are those that move."""
    moving = iter(zip(place, turn, strict=True))
    both = [(_fixed_place(t, sunk), np.array(t.turn)) if t.fixed else next(moving) for t in things]
    return np.stack([p for p, _ in both]), np.stack([q for _, q in both])


def _fixed_place(thing: Thing, sunk: float) -> np.ndarray:
    """Return the place of a fixed thing, the table `sunk` (m)."""
    return np.array(thing.place) + np.array([0.0, 0.0, sunk if thing.name == TABLE_NAME else 0.0])


def episode_path(folder: Path, name: str, number: int) -> Path:
    """Return the file of an episode."""
    return folder / EPISODES_FOLDER / name / f"{number:03d}.parquet"


def episode_sets(folder: Path) -> dict[str, list[Path]]:
    """Return the episodes of a folder of demonstrations by set, persons first; or those of one set.

    Raises DataError where there are none.
    """
    inside = folder / EPISODES_FOLDER
    set_folders = sorted((p for p in inside.glob("*/") if p.is_dir()), key=lambda p: (p.name != DEMONSTRATIONS, p.name))
    found = {p.name: sorted(p.glob("*.parquet")) for p in set_folders or [folder]}
    found = {name: files for name, files in found.items() if files}
    if not found:
        raise DataError(
            f"{folder} holds no stored trials; twin demonstrate TASK --out FOLDER stores them, in a new folder, and "
            "twin imitate FOLDER those of policies"
        )
    return found


def store_episode(file: Path, episode: Episode) -> None:
    """Write an episode, whole or not at all."""
    metadata = {
        "format": EPISODE_FORMAT, "told": asdict(episode.info), "outcome": episode.outcome,
        "things": [asdict(t) for t in episode.things],
        "shapes": {name: getattr(episode, name).shape[1:] for name in EPISODE_COLUMNS},
    }  # fmt: skip
    n = len(episode.time)
    table = pa.table({name: fixed_lists(getattr(episode, name).reshape(n, -1)) for name in EPISODE_COLUMNS})
    write_table(file, table.replace_schema_metadata({"twin": json.dumps(metadata)}), split=True)


def read_info(file: Path) -> tuple[EpisodeInfo, Outcome]:
    """Read what an episode is, without its frames. Raises DataError as `read_episode`."""
    metadata = _read_metadata(file)
    return EpisodeInfo(**metadata["told"]), Outcome(metadata["outcome"])


def read_episode(file: Path) -> Episode:
    """Read an episode. Raises DataError for a file that cannot be read or is no episode."""
    metadata = _read_metadata(file)
    table = pq.read_table(file)
    values = {name: column_array(table[name]).astype(float) for name in EPISODE_COLUMNS}
    shaped = {name: v.reshape(len(v), *metadata["shapes"][name]) for name, v in values.items()}
    return Episode(
        EpisodeInfo(**metadata["told"]), Outcome(metadata["outcome"]), tuple(_make_thing(t) for t in metadata["things"]), **shaped
    )


def _read_metadata(file: Path) -> dict[str, Any]:
    """Read the metadata of a file. Raises DataError for a file that is no episode."""
    try:
        metadata = json.loads((pq.read_schema(file).metadata or {})[b"twin"])
        valid = metadata["format"] == EPISODE_FORMAT
    except (OSError, pa.ArrowInvalid, KeyError, ValueError):
        valid = False
    if not valid:
        raise DataError(f"{file} is no trial of this program ({EPISODE_FORMAT}), or broken; delete it and make it again")
    return metadata


def _make_thing(table: dict[str, Any]) -> Thing:
    """Return the thing of a table of the metadata."""
    own: dict[str, Any] = {k: _as_tuples(v) for k, v in table.items()}
    parts = tuple(Part(**{k: _as_tuples(v) for k, v in part.items()}) for part in table["parts"])
    return Thing(**{**own, "parts": parts})


def _as_tuples(value: Any) -> Any:
    """Return the value with all lists turned to tuples."""
    return tuple(_as_tuples(v) for v in value) if isinstance(value, list) else value
