"""Several silicone fingers on one palm. At rest they are independent; in motion they share one MuJoCo model.

Finger k (from 1) stands at `places[k - 1]`, its frame rotated by `turns[k - 1]`. Tendons, sensors and markers are numbered on from
finger to finger.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from twin.body import Body, Loads, Problem, Solution
from twin.effects.contact import obstacle_in_frame
from twin.mechanics.silicone.body import SoftBody
from twin.mechanics.silicone.material.flex import flex_spec
from twin.mechanics.silicone.motion.dynamics import RestingBody, SoftMotion, motion_step, run_motion
from twin.mechanics.silicone.statics import SoftSolution, SoftStatics, rotation_about_z


@dataclass(frozen=True, kw_only=True)
class HandBody(Body):
    """Fingers, the numbers each was built from, their frames' origins (n, 3) m and rotations (n, 3, 3), in the palm's frame.

    A payload or a force at "the tip" is shared equally by all fingers; a push acts on one.
    """

    fingers: tuple[SoftBody, ...]
    numbers: tuple[Mapping[str, float], ...]
    places: np.ndarray
    turns: np.ndarray

    def first_mode_frequency(self) -> float:
        """Return the lowest first bending frequency (Hz) of the fingers."""
        return min(finger.first_mode_frequency() for finger in self.fingers)

    def set_bending_anisotropy(self, along: float, across: float) -> None:
        """Edit all fingers, as `SoftBody.set_bending_anisotropy`."""
        for finger in self.fingers:
            finger.set_bending_anisotropy(along, across)

    def set_stiffness_gradient(self, slope: float) -> None:
        """Edit all fingers, as `SoftBody.set_stiffness_gradient`."""
        for finger in self.fingers:
            finger.set_stiffness_gradient(slope)

    def set_rest_curvature(self, about_x: float, about_y: float, slope: float) -> None:
        """Edit all fingers, as `SoftBody.set_rest_curvature`."""
        for finger in self.fingers:
            finger.set_rest_curvature(about_x, about_y, slope)

    def move_tendon_holes(self, tendon: int, angle: float, further: float) -> None:
        """Move a tendon of the hand (from 0), as `SoftBody.move_tendon_holes`."""
        k, own = divmod(tendon, len(self.fingers[0].paths))
        self.fingers[k].move_tendon_holes(own, angle, further)

    def finger_loads(self, k: int, loads: Loads) -> Loads:
        """Return the loads of finger k (from 0), in its own frame."""
        turn, n = self.turns[k], len(self.fingers)
        wall = obstacle_in_frame(loads.wall, turn, self.places[k])
        push = loads.push if loads.push is not None and loads.push.finger == k else None
        if push is not None:
            push = replace(push, force=push.force @ turn, azimuth=push.azimuth - np.arctan2(turn[1, 0], turn[0, 0]))
        force, payload = loads.force @ turn / n, loads.payload / n
        return replace(loads, gravity=loads.gravity @ turn, payload=payload, force=force, wall=wall, push=push)

    def finger_problem(self, k: int, problem: Problem) -> Problem:
        """Return the part of a hand's problem for finger k (from 0); `delayed` is a copy, for `store_creep`."""
        nt = len(self.fingers[k].paths)
        own, drives = slice(k * nt, (k + 1) * nt), problem.drives
        delayed = None if problem.delayed is None else np.ascontiguousarray(np.split(problem.delayed, len(self.fingers), axis=1)[k])
        near = problem.neighbour.fingers[k] if isinstance(problem.neighbour, HandSolution) else None
        return replace(
            problem, command=np.ascontiguousarray(problem.command[:, own]), drives=drives[own] if len(drives) > nt else drives,
            loads=self.finger_loads(k, problem.loads), delayed=delayed, neighbour=near,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class HandSolution(Solution):
    """Solution of a hand; `fingers` are those of the fingers, in their own frames."""

    fingers: tuple[SoftSolution, ...]


def join_fingers(body: HandBody, paths: list[SoftSolution]) -> HandSolution:
    """Join the fingers' solutions to the hand's."""
    markers = [p.markers @ turn.T + place for p, turn, place in zip(paths, body.turns, body.places, strict=True)]
    return HandSolution(
        tension=np.hstack([p.tension for p in paths]),
        path=np.hstack([p.path for p in paths]),
        markers=np.concatenate(markers, axis=1),
        status=np.min([p.status for p in paths], axis=0),
        q=np.hstack([p.q for p in paths]),
        others={group: np.hstack([p.others[group] for p in paths]) for group in paths[0].others},
        start_status=max(p.start_status for p in paths),
        end_reason=next((p.end_reason for p in paths if p.end_reason), ""),
        fingers=tuple(paths),
    )


def store_creep(problem: Problem, shares: list[Problem]) -> None:
    """Copy the creep of the fingers' problems back into the hand's."""
    if problem.delayed is not None:
        problem.delayed[:] = np.hstack([share.delayed for share in shares if share.delayed is not None])


class HandStatics:
    """Statics of a hand: each finger by itself."""

    def __init__(self, body: HandBody) -> None:
        self.body = body
        self.fingers = [SoftStatics(finger) for finger in body.fingers]
        self.straight_path = np.concatenate([finger.straight_path for finger in self.fingers])

    @property
    def n_delayed(self) -> int:
        """Number of delayed strains of an element of creep."""
        return sum(finger.n_delayed for finger in self.fingers)

    def solve(self, problem: Problem) -> HandSolution:
        """Return the equilibria, as `SoftStatics.solve`; creep is advanced in place."""
        shares = [self.body.finger_problem(k, problem) for k in range(len(self.fingers))]
        paths = [finger.solve(share) for finger, share in zip(self.fingers, shares, strict=True)]
        store_creep(problem, shares)
        return join_fingers(self.body, paths)


def start_hand(body: HandBody, problem: Problem, longest: float = math.inf) -> tuple[list[RestingBody], mujoco.MjSpec]:
    """Return the fingers at rest under the first command, and a model of all of them.

    Steps are at most `longest` (s). More bodies may be added to the model afterwards.
    """
    resting = [RestingBody.of(finger, body.finger_problem(k, problem)) for k, finger in enumerate(body.fingers)]
    step = min(longest, *(motion_step(finger) for finger in body.fingers))
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = problem.loads.gravity
    for k, (one, place, turn) in enumerate(zip(resting, body.places, body.turns, strict=True)):
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(turn @ rotation_about_z(one.body.turn)).ravel())
        spec.attach(flex_spec(one.body, step), prefix=f"finger_{k + 1}_", frame=spec.worldbody.add_frame(pos=place, quat=quat))
    return resting, spec


def hand_motion(resting: list[RestingBody], spec: mujoco.MjSpec) -> SoftMotion:
    """Return the motion of all fingers in a model of `start_hand`."""
    fingers = range(1, len(resting) + 1)
    return SoftMotion.of(spec, resting, [f"finger_{k}_" for k in fingers], [f"finger {k}" for k in fingers])


class HandDynamics:
    """The fingers in one model, ready to be moved. They do not touch each other."""

    def __init__(self, body: HandBody) -> None:
        self.body = body
        self.statics = HandStatics(body)
        self.straight_path = self.statics.straight_path

    @property
    def n_delayed(self) -> int:
        """Number of delayed strains of an element of creep."""
        return self.statics.n_delayed

    def solve(self, problem: Problem) -> HandSolution:
        """Return the motion, as `SoftDynamics.solve`."""
        n = len(self.body.fingers)
        commands = np.array(problem.command, float).reshape(len(problem.time), n, -1)
        resting, spec = start_hand(self.body, problem)
        paths = run_motion(hand_motion(resting, spec), problem.time, commands)
        store_creep(problem, [one.problem for one in resting])
        return join_fingers(self.body, paths)
