"""Recorded task trials as they are drawn: the fingers of the hand and the things around it."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from twin.body import DIRECT, Loads, Route
from twin.body.drawable import Frames
from twin.foundation.errors import DataError
from twin.mechanics.silicone.drawing import HandFigure
from twin.mechanics.silicone.hand import HandStatics, join_fingers
from twin.mechanics.silicone.statics import SoftSolution
from twin.robots import load
from twin.tasks import make_task
from twin.tasks.imitation.demonstrate import hand_body
from twin.tasks.imitation.episode_store import Episode, read_episode
from twin.tasks.imitation.hand_model import draw_built_hand


@dataclass(frozen=True)
class DrawnTrial:
    """A recorded trial and its frames."""

    episode: Episode
    frames: Frames

    def poses(self, i: int, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Return place (thing, 3) m and rotation (thing, 4), interpolated by `share` from instant i to the next."""
        j = min(i + 1, len(self.episode.time) - 1)
        near, far = self.episode.turn[i], self.episode.turn[j]
        far = far * np.where((near * far).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]  # q and -q are the same rotation
        return _interpolate(self.episode.place[i], self.episode.place[j], share), _interpolate(near, far, share)

    def describe(self, i: int) -> str:
        """Describe the trial, its outcome, and where the object is now."""
        kept = self.episode
        moved = 1e3 * float(np.linalg.norm(kept.place[i, 0] - kept.place[0, 0]))
        return (
            f"**{kept.info.task}**, {performer(kept.info.who)}, {kept.info.number}: **{kept.outcome}**  \n"
            f"t = {kept.time[i] - kept.time[0]:.2f} s; {kept.things[0].name} moved by {moved:.1f} mm; tensions up to "
            f"{kept.tension[i].max():.2f} N"
        )

    @property
    def success(self) -> str:
        """Return the criterion of success."""
        return f"*success: {make_task(self.episode.info.task).success_criterion}*"


def _interpolate(near: np.ndarray, far: np.ndarray, share: float) -> np.ndarray:
    return (1.0 - share) * near + share * far


def performer(name: str) -> str:
    """Return who performed the trials of a set."""
    return "shown by hand" if name == "shown" else f"by {name}"


@lru_cache(maxsize=4)
def build_hand(robot: str, seed: int) -> tuple[HandFigure, HandStatics]:
    """Build the hand of a seed."""
    body = hand_body(load(robot), draw_built_hand(load(robot), seed))
    return HandFigure(body), HandStatics(body)


@lru_cache(maxsize=8)  # some 10 MB each
def read_drawn_trial(file: Path) -> DrawnTrial:
    """Read a trial and build its frames. Raises DataError as `read`, and for a hand of another lattice."""
    kept = read_episode(file)
    figure, statics = build_hand(kept.info.robot, kept.info.hand)
    fingers, nodes = len(statics.fingers), statics.fingers[0].body.lattice.n_free
    if kept.nodes.shape[1:3] != (fingers, nodes):
        said = " fingers of ".join(map(str, kept.nodes.shape[1:3]))
        raise DataError(f"{file}: {said} nodes, the robot has {fingers} of {nodes}; it was made with another description of it")
    paths = []
    for k, finger in enumerate(statics.fingers):
        u, tension = kept.nodes[:, k], kept.tension[:, k]
        known = np.full(len(u), DIRECT)
        markers, q = finger.markers(u), u.reshape(len(u), -1)
        paths.append(SoftSolution(tension=tension, path=np.zeros_like(tension), markers=markers, status=known, q=q))
    return DrawnTrial(kept, figure.frames(join_fingers(statics.body, paths), Loads(load(kept.info.robot).gravity), Route()))
