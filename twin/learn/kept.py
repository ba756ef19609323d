"""Trials kept to be looked at again: where the silicone and the things were, 25 frames a second.

    DATA/trials/shown/000.parquet                           what a person did, by number of the demonstration
    DATA/trials/diffusion-0-shape-hand1-seed0/007.parquet   what a policy did, by number of the trial
    DATA/trials/*/provenance.json                           command, seed, hash of what was shown, versions, date

A row a frame: time (s), nodes' displacements (finger, n_free, 3) m, tensions (finger, tendon) N, place (thing, 3) m and turn
(thing, 4) w x y z of all things, in single precision; what the things are and what became of it stand in the file's metadata.
Kept, not made anew from seed and number: a trial of 3 s takes 0.21 MB, and 0.1 s to be read and drawn, where to make it anew takes
2 s by hand and 4 s by tendons; and how a grasp ends can hang on the last bit, which another processor rounds otherwise.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from twin.errors import DataError
from twin.learn.lerobot import array, lists, write
from twin.soft.scene import Part, Thing
from twin.tasks import TABLE, Outcome, Trial

FORMAT = "twin-trial/1"
FOLDER, SHOWN = "trials", "shown"
EVERY, FPS = 2, 25  # steps a frame, frames a second
COLUMNS = ("time", "nodes", "tension", "place", "turn")


@dataclass(frozen=True)
class Told:
    """What a trial was: the task, the robot, the seed that built the hand, who did it, and its number."""

    task: str
    robot: str
    hand: int
    who: str
    number: int


@dataclass(frozen=True)
class Kept:
    """A trial: what it was, what became of it, its things; time (n,) s, nodes (n, f, k, 3) m, tension (n, f, t) N; of each thing,
    those that stay too, its place (n, thing, 3) m and turn (n, thing, 4)."""

    told: Told
    outcome: Outcome
    things: tuple[Thing, ...]
    time: np.ndarray
    nodes: np.ndarray
    tension: np.ndarray
    place: np.ndarray
    turn: np.ndarray

    @staticmethod
    def of(trial: Trial, told: Told) -> Kept:
        frames = trial.frames(EVERY)
        poses = [_poses(trial.things, sight.place, sight.turn, sunk) for sight, sunk in frames]
        place, turn = (np.stack(column) for column in zip(*poses, strict=True))
        sights = [sight for sight, _ in frames]
        return Kept(
            told, trial.outcome(), trial.things, np.array([s.time for s in sights]), np.stack([s.nodes for s in sights]),
            np.stack([s.tension for s in sights]), place, turn,
        )  # fmt: skip


def _poses(
    things: tuple[Thing, ...], place: np.ndarray, turn: np.ndarray, sunk: float
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Of all things, of which `place` and `turn` are those that move."""
    moving = iter(zip(place, turn, strict=True))
    both = [(_standing(t, sunk), np.array(t.turn)) if t.fixed else next(moving) for t in things]
    return np.stack([p for p, _ in both]), np.stack([q for _, q in both])


def _standing(thing: Thing, sunk: float) -> np.ndarray:
    return np.array(thing.place) + np.array([0.0, 0.0, sunk if thing.name == TABLE else 0.0])


def file_of(folder: Path, name: str, number: int) -> Path:
    return folder / FOLDER / name / f"{number:03d}.parquet"


def sets(folder: Path) -> dict[str, list[Path]]:
    """The trials of a folder of demonstrations, of persons first, then by policy; or of one set of them. Raises DataError where
    there are none."""
    inside = folder / FOLDER
    own = sorted((p for p in inside.glob("*/") if p.is_dir()), key=lambda p: (p.name != SHOWN, p.name))
    found = {p.name: sorted(p.glob("*.parquet")) for p in own or [folder]}
    found = {name: files for name, files in found.items() if files}
    if not found:
        raise DataError(
            f"{folder} holds no trials to look at; twin demonstrate TASK --out FOLDER keeps them, in a new folder, and "
            "twin imitate FOLDER those of policies"
        )
    return found


def keep(file: Path, kept: Kept) -> None:
    """Whole or not at all."""
    about = {
        "format": FORMAT, "told": asdict(kept.told), "outcome": kept.outcome, "things": [asdict(t) for t in kept.things],
        "shapes": {name: getattr(kept, name).shape[1:] for name in COLUMNS},
    }  # fmt: skip
    n = len(kept.time)
    table = pa.table({name: lists(getattr(kept, name).reshape(n, -1)) for name in COLUMNS})
    write(file, table.replace_schema_metadata({"twin": json.dumps(about)}), split=True)


def told(file: Path) -> tuple[Told, Outcome]:
    """What a file is of, without its frames. Raises DataError as `read`."""
    about = _about(file)
    return Told(**about["told"]), Outcome(about["outcome"])


def read(file: Path) -> Kept:
    """Raises DataError for a file that cannot be read or is no trial."""
    about = _about(file)
    table = pq.read_table(file)
    values = {name: array(table[name]).astype(float) for name in COLUMNS}
    shaped = {name: v.reshape(len(v), *about["shapes"][name]) for name, v in values.items()}
    return Kept(Told(**about["told"]), Outcome(about["outcome"]), tuple(_thing(t) for t in about["things"]), **shaped)


def _about(file: Path) -> dict[str, Any]:
    try:
        about = json.loads((pq.read_schema(file).metadata or {})[b"twin"])
        whole = about["format"] == FORMAT
    except (OSError, pa.ArrowInvalid, KeyError, ValueError):
        whole = False
    if not whole:
        raise DataError(f"{file} is no trial of this program ({FORMAT}), or broken; delete it and make it again")
    return about


def _thing(table: dict[str, Any]) -> Thing:
    own: dict[str, Any] = {k: _tupled(v) for k, v in table.items()}
    parts = tuple(Part(**{k: _tupled(v) for k, v in part.items()}) for part in table["parts"])
    return Thing(**{**own, "parts": parts})


def _tupled(value: Any) -> Any:
    return tuple(_tupled(v) for v in value) if isinstance(value, list) else value
