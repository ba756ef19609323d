"""Kept trials as they are drawn: the hand's fingers, and the things that stand, lie and roll around it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from twin.body import DIRECT
from twin.effects import Loads, Route
from twin.errors import DataError
from twin.figure import Frames
from twin.learn.demonstrate import body_of
from twin.learn.hands import built
from twin.learn.kept import Kept, read
from twin.robots import load
from twin.soft.figure import HandFigure
from twin.soft.hand import HandStatics, joined
from twin.soft.statics import SoftPath
from twin.tasks import task


@dataclass(frozen=True)
class Stage:
    """A trial and its frames."""

    kept: Kept
    frames: Frames

    def poses(self, i: int, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Place (thing, 3) m and turn (thing, 4), `share` of the way from instant i to the next."""
        j = min(i + 1, len(self.kept.time) - 1)
        near, far = self.kept.turn[i], self.kept.turn[j]
        far = far * np.where((near * far).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]  # q and -q are the same turn
        return _way(self.kept.place[i], self.kept.place[j], share), _way(near, far, share)

    def words(self, i: int) -> str:
        """What it is, what became of it, and where the object is now."""
        kept = self.kept
        moved = 1e3 * float(np.linalg.norm(kept.place[i, 0] - kept.place[0, 0]))
        return (
            f"**{kept.told.task}**, {who(kept.told.who)}, {kept.told.number}: **{kept.outcome}**  \n"
            f"t = {kept.time[i] - kept.time[0]:.2f} s; {kept.things[0].name} moved by {moved:.1f} mm; tensions up to "
            f"{kept.tension[i].max():.2f} N"
        )

    @property
    def wanted(self) -> str:
        """What counts as success."""
        return f"*success: {task(self.kept.told.task).success}*"


def _way(near: np.ndarray, far: np.ndarray, share: float) -> np.ndarray:
    return (1.0 - share) * near + share * far


def who(name: str) -> str:
    """Of a set's name: who did it."""
    return "shown by hand" if name == "shown" else f"by {name}"


@lru_cache(maxsize=4)
def hand(robot: str, seed: int) -> tuple[HandFigure, HandStatics]:
    """The hand that a seed builds."""
    body = body_of(load(robot), built(load(robot), seed))
    return HandFigure(body), HandStatics(body)


@lru_cache(maxsize=8)  # some 10 MB each
def stage(file: Path) -> Stage:
    """Raises DataError as `read`, and for a hand of another lattice than today's."""
    kept = read(file)
    figure, statics = hand(kept.told.robot, kept.told.hand)
    fingers, nodes = len(statics.fingers), statics.fingers[0].body.lattice.n_free
    if kept.nodes.shape[1:3] != (fingers, nodes):
        said = " fingers of ".join(map(str, kept.nodes.shape[1:3]))
        raise DataError(f"{file}: {said} nodes, the robot has {fingers} of {nodes}; it was made with another description of it")
    paths = []
    for k, finger in enumerate(statics.fingers):
        u, tension = kept.nodes[:, k], kept.tension[:, k]
        known = np.full(len(u), DIRECT)
        markers, q = finger.markers(u), u.reshape(len(u), -1)
        paths.append(SoftPath(tension=tension, path=np.zeros_like(tension), markers=markers, status=known, q=q))
    return Stage(kept, figure.frames(joined(statics.body, paths), Loads(load(kept.told.robot).gravity), Route()))
