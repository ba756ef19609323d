"""Several silicone fingers on one palm. At rest they do not feel each other; in motion they share one MuJoCo model.

Finger k (from 1) stands at `places[k - 1]`, its frame turned by `turns[k - 1]`. Tendons, sensors and markers are numbered on from
finger to finger.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from twin.body import Body, Path, Problem
from twin.effects import Loads
from twin.effects.contact import seen_from
from twin.soft.body import SoftBody
from twin.soft.dynamics import Moving, Started, followed, step_for
from twin.soft.flex import flex
from twin.soft.statics import SoftPath, SoftStatics, turned


@dataclass(frozen=True, kw_only=True)
class HandBody(Body):
    """Fingers, the numbers that each was built of, where their frames are (n, 3) m and how they are turned (n, 3, 3), in the
    palm's frame. A payload or a force at "the tip" is held by all fingers alike; a push is on one."""

    fingers: tuple[SoftBody, ...]
    numbers: tuple[Mapping[str, float], ...]
    places: np.ndarray
    turns: np.ndarray

    def first_mode(self) -> float:
        return min(finger.first_mode() for finger in self.fingers)

    def bend_unequally(self, along: float, across: float) -> None:
        for finger in self.fingers:
            finger.bend_unequally(along, across)

    def grade(self, slope: float) -> None:
        for finger in self.fingers:
            finger.grade(slope)

    def precurve(self, about_x: float, about_y: float, slope: float) -> None:
        for finger in self.fingers:
            finger.precurve(about_x, about_y, slope)

    def reroute(self, tendon: int, angle: float, further: float) -> None:
        k, own = divmod(tendon, len(self.fingers[0].paths))
        self.fingers[k].reroute(own, angle, further)

    def felt(self, k: int, loads: Loads) -> Loads:
        """As finger k (from 0) has them, in its own frame."""
        turn, n = self.turns[k], len(self.fingers)
        wall = seen_from(loads.wall, turn, self.places[k])
        push = loads.push if loads.push is not None and loads.push.finger == k else None
        if push is not None:
            push = replace(push, force=push.force @ turn, azimuth=push.azimuth - np.arctan2(turn[1, 0], turn[0, 0]))
        force, payload = loads.force @ turn / n, loads.payload / n
        return replace(loads, gravity=loads.gravity @ turn, payload=payload, force=force, wall=wall, push=push)

    def share(self, k: int, problem: Problem) -> Problem:
        """What a problem of the hand asks of finger k (from 0); `delayed` is a copy, for `keep_delayed`."""
        nt = len(self.fingers[k].paths)
        own, drives = slice(k * nt, (k + 1) * nt), problem.drives
        delayed = None if problem.delayed is None else np.ascontiguousarray(np.split(problem.delayed, len(self.fingers), axis=1)[k])
        near = problem.near.fingers[k] if isinstance(problem.near, HandPath) else None
        return replace(
            problem, command=np.ascontiguousarray(problem.command[:, own]), drives=drives[own] if len(drives) > nt else drives,
            loads=self.felt(k, problem.loads), delayed=delayed, near=near,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class HandPath(Path):
    """`fingers` are their own answers, in their own frames."""

    fingers: tuple[SoftPath, ...]


def joined(body: HandBody, paths: list[SoftPath]) -> HandPath:
    """The fingers' answers as the hand's."""
    markers = [p.markers @ turn.T + place for p, turn, place in zip(paths, body.turns, body.places, strict=True)]
    return HandPath(
        tension=np.hstack([p.tension for p in paths]),
        path=np.hstack([p.path for p in paths]),
        markers=np.concatenate(markers, axis=1),
        status=np.min([p.status for p in paths], axis=0),
        q=np.hstack([p.q for p in paths]),
        others={group: np.hstack([p.others[group] for p in paths]) for group in paths[0].others},
        started=max(p.started for p in paths),
        ended=next((p.ended for p in paths if p.ended), ""),
        fingers=tuple(paths),
    )


def keep_delayed(problem: Problem, shares: list[Problem]) -> None:
    """What creep has left in the fingers, back into the hand's problem."""
    if problem.delayed is not None:
        problem.delayed[:] = np.hstack([share.delayed for share in shares if share.delayed is not None])


class HandStatics:
    """Each finger by itself."""

    def __init__(self, body: HandBody) -> None:
        self.body = body
        self.fingers = [SoftStatics(finger) for finger in body.fingers]
        self.straight_path = np.concatenate([finger.straight_path for finger in self.fingers])

    @property
    def n_slow(self) -> int:
        return sum(finger.n_slow for finger in self.fingers)

    def solve(self, problem: Problem) -> HandPath:
        """As `SoftStatics.solve`; what creep has left is advanced in place."""
        shares = [self.body.share(k, problem) for k in range(len(self.fingers))]
        paths = [finger.solve(share) for finger, share in zip(self.fingers, shares, strict=True)]
        keep_delayed(problem, shares)
        return joined(self.body, paths)


def stand(body: HandBody, problem: Problem, longest: float = math.inf) -> tuple[list[Started], mujoco.MjSpec]:
    """The fingers at rest under the first command, and a model of all of them, to which more may be added after, with steps of
    `longest` (s) at most."""
    started = [Started.of(finger, body.share(k, problem)) for k, finger in enumerate(body.fingers)]
    step = min(longest, *(step_for(finger) for finger in body.fingers))
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = problem.loads.gravity
    for k, (one, place, turn) in enumerate(zip(started, body.places, body.turns, strict=True)):
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(turn @ turned(one.body.turn)).ravel())
        spec.attach(flex(one.body, step), prefix=f"finger_{k + 1}_", frame=spec.worldbody.add_frame(pos=place, quat=quat))
    return started, spec


def moving(started: list[Started], spec: mujoco.MjSpec) -> Moving:
    fingers = range(1, len(started) + 1)
    return Moving.of(spec, started, [f"finger_{k}_" for k in fingers], [f"finger {k}" for k in fingers])


class HandDynamics:
    """The fingers in one model, ready to be moved. They do not touch each other."""

    def __init__(self, body: HandBody) -> None:
        self.body = body
        self.statics = HandStatics(body)
        self.straight_path = self.statics.straight_path

    @property
    def n_slow(self) -> int:
        return self.statics.n_slow

    def solve(self, problem: Problem) -> HandPath:
        """As `SoftDynamics.solve`."""
        n = len(self.body.fingers)
        commands = np.array(problem.command, float).reshape(len(problem.time), n, -1)
        started, spec = stand(self.body, problem)
        paths = followed(moving(started, spec), problem.time, commands)
        keep_delayed(problem, [one.problem for one in started])
        return joined(self.body, paths)
