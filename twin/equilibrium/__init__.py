"""The static solve that quasi-static prediction and kinematics stand on.

engine.py   MuJoCo's kinematics, called by symbol      elastic.py  the elastic energy
chain.py    balance of forces and its tangent          newton.py   one equilibrium
linear.py   factorisation                              lengths.py  tensions that hold given tendon lengths
move.py     from one equilibrium to another            hyperelastic.py  the energy of a body that stretches
trial.py    what all trials share                      pulled.py  a trial of given tensions, sample by sample
antagonists.py  a jaw between two tendons              held.py    a trial of tendons held at lengths or by SMA springs
holder.py   what holds a tendon, a motor or a spring
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import mujoco
import numpy as np

from twin.body import Path, Problem, fingerprint
from twin.effects import Drive, Loads, Push, Route
from twin.equilibrium import held, pulled
from twin.equilibrium.chain import Chain, Law, Load, State, Statics
from twin.equilibrium.elastic import COUPLING
from twin.equilibrium.holder import STIFFEST, of_play
from twin.equilibrium.trial import Driving, Found, How, Near, Slow, seen
from twin.hinges import HingeChain, hinge_pairs
from twin.springs.spring import Spring, no_springs

__all__ = ["ChainPath", "Equilibrium"]


@dataclass(frozen=True, kw_only=True)
class ChainPath(Path):
    """The equilibria of a chain, with slip states and distal tendon lengths (n_tendon, n_piece) at the end. `others` holds the
    temperature (n, n_tendon) K of its springs, `yielding` (n, n_tendon, nv) rad/N how joints answer to held tendons, or nothing.
    `of` is a hash of all that the shapes follow from, or empty."""

    slip: np.ndarray
    distal: np.ndarray
    yielding: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 0)), repr=False)
    of: bytes = b""


class Equilibrium:
    """A compiled chain ready to be solved. Holds a MuJoCo model and data, so one instance serves one thread at a time."""

    def __init__(self, body: HingeChain) -> None:
        self.model = model = body.spec.compile()
        self.data = data = mujoco.MjData(model)
        site = np.vectorize(lambda name: model.site(name).id, otypes=[np.int64])
        pieces = np.array([len(tendon) - 1 for tendon in body.tendons], np.int64)
        longest = int(pieces.max())
        hole = site(np.array([[*tendon, *tendon[-1:] * (longest + 1 - len(tendon))] for tendon in body.tendons]))
        disk = site(np.array(body.disks))
        stiffness = model.jnt_stiffness.reshape(model.nv, -1)[:, 0].copy()
        dof = {model.joint(i).name: model.joint(i).dofadr[0] for i in range(model.njnt)}
        partner, coupling, slender = np.arange(model.nv), np.zeros(model.nv), np.zeros(model.nv)
        unit, hinge, twists = np.ones(model.nv), np.ones(model.nv), np.zeros(model.nv, bool)
        for one, other in hinge_pairs(body) if body.bows else ():
            a, b = dof[one], dof[other]
            partner[a], partner[b] = b, a
            coupling[[a, b]] = COUPLING * 0.5 * (stiffness[a] + stiffness[b])
        for at in body.joints:
            twists[dof[at.twist]] = True
            if at.slide is not None:
                unit[dof[at.slide]], hinge[dof[at.slide]] = at.length, 0.0
            for bend in (at.bend_x, at.bend_y) if body.bows else ():
                slender[dof[bend]] = 4.0 * at.length / stiffness[dof[bend]]
        hinges = np.zeros(model.nbody, np.int64)  # from the base up to and with each body
        for b in range(1, model.nbody):
            hinges[b] = hinges[model.body_parentid[b]] + model.body_dofnum[b]
        moved_by = model.dof_bodyid.astype(np.int64)
        self.chain = Chain(
            anchor=data.xanchor,
            axis=data.xaxis,
            centre=data.subtree_com,
            site=data.site_xpos,
            qpos=data.qpos,
            stiffness=stiffness,
            unit=unit,
            hinge=hinge,
            twists=twists,
            slender=slender,
            partner=partner,
            coupling=coupling,
            bends=np.array([min(dof[at.bend_x], dof[at.bend_y]) for at in body.joints], np.int64),
            slide=np.array([dof[at.slide] for at in body.joints if at.slide is not None], np.int64),
            lever=np.zeros((len(body.tendons) if any(at.slide for at in body.joints) else 0, model.nv)),
            stiffening=float(body.stiffening),
            hand=np.linalg.det(model.jnt_axis[hinge > 0.0].reshape(-1, 3, 3)),
            body=moved_by,
            mass=model.body_subtreemass[moved_by].copy(),
            hole=hole,
            pieces=pieces,
            first=hinges[model.site_bodyid[hole[pieces.argmax()]]],
            disk=disk,
            below=hinges[model.site_bodyid[disk]],
            marker=site(np.array(body.markers)),
        )
        self.spring = model.qpos_spring.copy()
        mujoco.mj_kinematics(model, data)
        ends = data.site_xpos[hole]
        self._arclength = data.site_xpos[disk, 2] / body.length  # of each disk on the straight robot
        self.straight_path: np.ndarray = np.linalg.norm(np.diff(ends, axis=1), axis=2).sum(axis=1)  # (n_tendon,) m
        if self.chain.lever.size:
            self._in_channels(ends)
        moves = (
            model.body_parentid, model.body_pos, model.body_quat, model.body_ipos, model.body_mass, model.jnt_pos, model.jnt_axis,
            model.site_bodyid[hole], model.site_pos[hole], model.site_bodyid[disk], model.site_pos[disk], self.spring,
        )  # fmt: skip
        # Of the chain all but what MuJoCo moves, at its head, and the markers, at its end.
        self._body = np.frombuffer(fingerprint(*moves, *map(np.asarray, self.chain[5:-1])), np.uint8)

    def _in_channels(self, ends: np.ndarray) -> None:
        """Sets `chain.lever`: how much longer a bend makes the channel's piece it is in, the body straight, its holes at `ends`."""
        chain = self.chain
        span = np.diff(ends, axis=1)
        along = span / np.maximum(np.linalg.norm(span, axis=2, keepdims=True), np.finfo(float).tiny)
        joints = np.arange(chain.first[0], chain.first[-1])
        piece = np.searchsorted(chain.first, joints, side="right") - 1
        turned = np.cross(self.data.xaxis[joints], ends[:, piece + 1] - self.data.xanchor[joints])
        bends = (chain.hinge[joints] > 0.0) & ~chain.twists[joints] & (piece < chain.pieces[:, None])
        chain.lever[:, joints] = bends * (turned * along[:, piece]).sum(axis=2)

    @property
    def n_slow(self) -> int:
        return int(self.model.nv)

    def statics(self, problem: Problem) -> Statics:
        """What is in balance under the problem's loads."""
        loads, route = problem.loads, problem.route
        law = Law(float(route.mu), float(route.presliding), np.array(loads.wall, float))
        return Statics(self.model._address, self.data._address, self.chain, self.spring, law, self.load(loads))

    def load(self, loads: Loads, softness: float = 1.0) -> Load:
        """Loads as statics knows them: over the stiffness, but for the payload, which gravity makes a force."""
        push = loads.push or Push(np.zeros(3))
        pushed = int(np.abs(self._arclength - push.height).argmin())
        gravity, force, aside = (softness * np.array(v, float) for v in (loads.gravity, loads.force, push.force))
        return Load(gravity, float(loads.payload), force, aside, pushed)

    def driving(self, problem: Problem) -> Driving:
        """What drives the trial."""
        n, nt = problem.command.shape
        by_length, by_spring = problem.which(Drive.DISPLACEMENT), problem.which(Drive.CURRENT)
        heating = problem.heating
        play, swap, _, _ = of_play(problem.route, self.straight_path, by_spring)
        # In one order in memory: the loop is compiled anew for another, which takes half a minute.
        command = np.ascontiguousarray(np.where(by_length, problem.command, np.maximum(problem.command, 0.0)))
        return Driving(
            time=np.array(problem.time, float),
            command=command,
            by_length=by_length,
            by_spring=by_spring,
            straight=self.zero_path(problem.route, by_spring, None if heating is None else heating.spring),
            stretch=float(problem.route.stretch),
            bedding=float(problem.route.bedding),
            bedding_tension=float(problem.route.bedding_tension),
            play=play,
            swap=swap,
            stall=float(problem.route.stall),
            least_stretch=STIFFEST,
            stiffness=np.ones(n) if problem.stiffness is None else np.array(problem.stiffness, float),
            ambient=np.zeros(n) if heating is None else np.array(heating.ambient, float),
            spring=_unsprung(nt) if heating is None else heating.spring.records,
        )

    @cached_property
    def rest_path(self) -> np.ndarray:
        """(n_tendon,) m: path lengths of the unloaded body, bent as it rests, its tendons paid out."""
        paid_out, held_by = -self.straight_path[None], (Drive.DISPLACEMENT,) * len(self.straight_path)
        return self.solve(Problem(np.zeros(1), paid_out, Loads(np.zeros(3)), drives=held_by)).path[0]

    def zero_path(self, route: Route, by_spring: np.ndarray, springs: Spring | None) -> np.ndarray:
        """(n_tendon,) m: path lengths at which motors stand at zero, and springs are as long as when they were put on."""
        if springs is None or not by_spring.any():
            return self.straight_path
        put_on = self.straight_path - by_spring * route.hooked * route.elongation(springs.initial_tension)
        return put_on + route.mounted * by_spring * (self.rest_path - self.straight_path) if route.mounted else put_on

    def solve(self, problem: Problem) -> ChainPath:
        """Equilibria in the order of `twin.equilibrium.pulled`, or `held` where a tendon is held at a length or by a spring.

        Where no equilibrium was found the sample's status is NOT_FOUND and its shape is the one before.
        """
        (n, nt), nv, creep, near = problem.command.shape, self.n_slow, problem.creep, problem.near
        amplitude = np.array(creep.amplitude, float)
        delayed = np.zeros((amplitude.size, nv)) if problem.delayed is None else problem.delayed
        nd = self.chain.hole.shape[1] - 1
        state = State(np.zeros(nt), np.empty(nv), np.zeros((nt, nd)), np.zeros((nt, nd)))
        driving, what = self.driving(problem), self.statics(problem)
        asked = b"" if amplitude.size else self._asked(driving, what)  # creep's state must be advanced
        if isinstance(near, ChainPath) and near.of == asked != b"" and (not problem.keep or near.LU.size):
            markers = np.empty_like(near.markers)
            seen(what, near.q, markers)  # what differs is only where markers sit
            return replace(near, markers=markers)
        holds, kept = bool(np.any(driving.by_length | driving.by_spring)), n if problem.keep else 0
        found = Found(
            LU=np.empty((kept, nv, nv)),
            yielding=np.empty((kept if holds else 0, nt, nv)),
            q=np.empty((n, nv)),
            tension=np.empty((n, nt)),
            markers=np.empty((n, self.chain.marker.size, 3)),
            path=np.empty((n, nt)),
            temperature=np.empty((n, nt)),
            status=np.empty(n, np.int64),
        )
        started = (held.run if holds else pulled.run)(
            what,
            driving,
            Slow(amplitude, np.array(creep.time, float), delayed),
            Near(near.q, near.tension, near.LU, near.yielding)
            if isinstance(near, ChainPath)
            else Near(np.empty((0, nv)), np.empty((0, nt)), found.LU[:0], found.yielding[:0]),
            How(float(problem.tolerance), problem.keep, problem.once),
            state,
            found,
        )
        return ChainPath(
            tension=found.tension, path=found.path, markers=found.markers, status=found.status, q=found.q,
            others={"temperature": found.temperature}, started=int(started), LU=found.LU, slip=state.z, distal=state.s,
            yielding=found.yielding, of=asked if found.status.all() else b"",
        )  # fmt: skip

    def _asked(self, driving: Driving, what: Statics) -> bytes:
        """A hash of all that the shapes follow from."""
        return fingerprint(self._body, *map(np.asarray, (*driving, *what.law, *what.load)))


@cache
def _unsprung(n: int) -> np.ndarray:
    """Records for n tendons that no spring pulls."""
    return no_springs(n).records
