"""Static solve of a hinge chain, the base of quasi-static prediction and kinematics."""

from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from twin.body import Drive, Loads, Problem, Push, Route, Solution, array_hash
from twin.body.drives.spring import Spring, placeholder_springs
from twin.body.hinge_chain import HingeChain
from twin.mechanics.rod import held_trials, tension_trials
from twin.mechanics.rod.balance.chain import ChainState, ContactLaw, StaticLoad, StaticSystem
from twin.mechanics.rod.balance.compile_chain import compile_chain
from twin.mechanics.rod.balance.tendon_actuation import LEAST_STRETCH, initial_backlash
from twin.mechanics.rod.trial_steps import CreepState, Neighbour, SolveMode, TrialDrive, TrialResult, markers_of_shapes


@dataclass(frozen=True, kw_only=True)
class ChainSolution(Solution):
    """Equilibria of a chain, with slip states and distal tendon lengths (n_tendon, n_piece) at the end.

    `others` holds the temperature (n, n_tendon) K of its springs. `tension_response` (n, n_tendon, nv) rad/N is the response of the
    joints to held tendons, or empty. `fingerprint` is a hash of everything that determines the shapes, or empty.
    """

    slip: np.ndarray
    distal: np.ndarray
    tension_response: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 0)), repr=False)
    fingerprint: bytes = b""


class Equilibrium:
    """A compiled chain ready to be solved. It holds a MuJoCo model and data, so one instance serves one thread at a time."""

    def __init__(self, body: HingeChain) -> None:
        self.model = model = body.spec.compile()
        self.pushes, self.borne = body.pushes, body.borne
        self.data = data = mujoco.MjData(model)
        self.chain = chain = compile_chain(body, model, data)
        self.spring = model.qpos_spring.copy()
        ends = data.site_xpos[chain.hole]
        self._arclength = data.site_xpos[chain.disk, 2] / body.length  # of each disk on the straight robot
        self.straight_path: np.ndarray = np.linalg.norm(np.diff(ends, axis=1), axis=2).sum(axis=1)  # (n_tendon,) m
        moves = (
            model.body_parentid, model.body_pos, model.body_quat, model.body_ipos, model.body_mass, model.jnt_pos, model.jnt_axis,
            model.site_bodyid[chain.hole], model.site_pos[chain.hole], model.site_bodyid[chain.disk], model.site_pos[chain.disk],
            self.spring,
        )  # fmt: skip
        # All of the chain except MuJoCo's views at its head and the markers at its end.
        self._body = np.frombuffer(array_hash(*moves, *(np.asarray(a) for a in chain[5:-1] if a is not None)), np.uint8)

    @property
    def n_delayed(self) -> int:
        """Number of delayed strains of an element of creep."""
        return int(self.model.nv)

    def statics(self, problem: Problem) -> StaticSystem:
        """Return the system in balance under the problem's loads."""
        loads, route = problem.loads, problem.route
        law = ContactLaw(float(route.mu), float(route.presliding), np.array(loads.wall, float))
        return StaticSystem(self.model._address, self.data._address, self.chain, self.spring, law, self.static_load(loads))

    def static_load(self, loads: Loads, softness: float = 1.0) -> StaticLoad:
        """Return the loads over the stiffness (times `softness`); the payload stays a mass, which gravity makes a force."""
        push = loads.push or Push(np.zeros(3))
        pushed = int(np.abs(self._arclength - push.height).argmin())
        gravity, force, aside = (softness * np.array(v, float) for v in (loads.gravity, loads.force, push.force))
        return StaticLoad(gravity, float(loads.payload), force, aside, pushed)

    def trial_drive(self, problem: Problem) -> TrialDrive:
        """Return the inputs of the trial."""
        n, nt = problem.command.shape
        by_length, by_spring = problem.drive_mask(Drive.DISPLACEMENT), problem.drive_mask(Drive.CURRENT)
        heating = problem.heating
        backlash, crossing_travel, _, _ = initial_backlash(problem.route, self.straight_path, by_spring)
        # Contiguous: for another memory layout the loop would be compiled again, which takes half a minute.
        command = np.ascontiguousarray(np.where(by_length, problem.command, self.borne(problem.command)))
        return TrialDrive(
            time=np.array(problem.time, float),
            command=command,
            driven_by_length=by_length,
            by_spring=by_spring,
            straight_path=self.zero_path(problem.route, by_spring, None if heating is None else heating.spring),
            stretch=float(problem.route.stretch),
            bedding=float(problem.route.bedding),
            bedding_tension=float(problem.route.bedding_tension),
            backlash=backlash,
            crossing_travel=crossing_travel,
            stall_tension=float(problem.route.stall_tension),
            least_stretch=LEAST_STRETCH,
            stiffness=np.ones(n) if problem.stiffness is None else np.array(problem.stiffness, float),
            ambient=np.zeros(n) if heating is None else np.array(heating.ambient, float),
            spring=_no_spring_records(nt) if heating is None else heating.spring.records,
            pushes=self.pushes,
        )

    @cached_property
    def rest_path(self) -> np.ndarray:
        """(n_tendon,) m: path lengths of the unloaded body, bent as it rests, with all tendons paid out."""
        paid_out, held_by = -self.straight_path[None], (Drive.DISPLACEMENT,) * len(self.straight_path)
        return self.solve(Problem(np.zeros(1), paid_out, Loads(np.zeros(3)), drives=held_by)).path[0]

    def zero_path(self, route: Route, by_spring: np.ndarray, springs: Spring | None) -> np.ndarray:
        """Return (n_tendon,) m: path lengths at which motors are at zero, and springs as long as when they were mounted."""
        if springs is None or not by_spring.any():
            return self.straight_path
        mounted = self.straight_path - by_spring * route.initial_stretch_share * route.elongation(springs.initial_tension)
        if not route.rest_bend_share:
            return mounted
        return mounted + route.rest_bend_share * by_spring * (self.rest_path - self.straight_path)

    def orientations(self, q: np.ndarray, sites: tuple[str, ...]) -> np.ndarray:
        """Return rotation vectors (n, n_site, 3) rad of sites at shapes q (n, nv)."""
        at = [self.model.site(name).id for name in sites]
        matrices = np.empty((len(q), len(at), 9))
        for i, shape in enumerate(q):
            self.data.qpos[:] = shape
            mujoco.mj_kinematics(self.model, self.data)
            matrices[i] = self.data.site_xmat[at]
        return Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec().reshape(len(q), len(at), 3)

    def solve(self, problem: Problem) -> ChainSolution:
        """Return the equilibria, in the order of loads of `twin.mechanics.rod.tension_trials`, or `held_trials` where tendons are
        held.

        Where no equilibrium was found the sample's status is NOT_FOUND and its shape is the one before.
        """
        (n, nt), nv, creep, near = problem.command.shape, self.n_delayed, problem.creep, problem.neighbour
        amplitude = np.array(creep.amplitude, float)
        delayed = np.zeros((amplitude.size, nv)) if problem.delayed is None else problem.delayed
        nd = self.chain.hole.shape[1] - 1
        state = ChainState(np.zeros(nt), np.empty(nv), np.zeros((nt, nd)), np.zeros((nt, nd)))
        drive, system = self.trial_drive(problem), self.statics(problem)
        problem_hash = b"" if amplitude.size else self._problem_hash(drive, system)  # with creep the strains must be advanced
        if isinstance(near, ChainSolution) and near.fingerprint == problem_hash != b"" and (not problem.keep or near.LU.size):
            markers = np.empty_like(near.markers)
            markers_of_shapes(system, near.q, markers)  # only the markers' positions on the body differ
            return replace(near, markers=markers)
        holds, n_kept = bool(np.any(drive.driven_by_length | drive.by_spring)), n if problem.keep else 0
        result = TrialResult(
            LU=np.empty((n_kept, nv, nv)),
            tension_response=np.empty((n_kept if holds else 0, nt, nv)),
            q=np.empty((n, nv)),
            tension=np.empty((n, nt)),
            markers=np.empty((n, self.chain.marker.size, 3)),
            path=np.empty((n, nt)),
            temperature=np.empty((n, nt)),
            status=np.empty(n, np.int64),
        )
        neighbour = (
            Neighbour(near.q, near.tension, near.LU, near.tension_response)
            if isinstance(near, ChainSolution)
            else Neighbour(np.empty((0, nv)), np.empty((0, nt)), result.LU[:0], result.tension_response[:0])
        )
        creep_state = CreepState(amplitude, np.array(creep.time, float), delayed)
        mode = SolveMode(float(problem.tolerance), problem.keep, problem.once)
        run_trial = held_trials.run_trial if holds else tension_trials.run_trial
        started = run_trial(system, drive, creep_state, neighbour, mode, state, result)
        return ChainSolution(
            tension=result.tension, path=result.path, markers=result.markers, status=result.status, q=result.q,
            others={"temperature": result.temperature}, start_status=int(started), LU=result.LU, slip=state.z, distal=state.s,
            tension_response=result.tension_response, fingerprint=problem_hash if result.status.all() else b"",
        )  # fmt: skip

    def _problem_hash(self, drive: TrialDrive, system: StaticSystem) -> bytes:
        """Return a hash of everything that determines the shapes."""
        return array_hash(self._body, *map(np.asarray, (*drive, *system.law, *system.load)))


@cache
def _no_spring_records(n: int) -> np.ndarray:
    """Return records for n tendons without springs."""
    return placeholder_springs(n).records
