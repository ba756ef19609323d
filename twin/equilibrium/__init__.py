"""The static solve that quasi-static prediction and kinematics stand on.

engine.py   MuJoCo's kinematics, called by symbol      elastic.py  the elastic energy
chain.py    balance of forces and its tangent          newton.py   one equilibrium
linear.py   factorisation                              lengths.py  tensions that hold given tendon lengths
move.py     from one equilibrium to another            hyperelastic.py  the energy of a body that stretches
trial.py    a trial, sample by sample             antagonists.py  a jaw between two tendons
path.py     the equilibria of a trial
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path as File

import mujoco
import numpy as np

from twin.effects import Creep, Loads, Route
from twin.equilibrium.antagonists import Antagonists
from twin.equilibrium.chain import Chain, Law, Load
from twin.equilibrium.elastic import COUPLING
from twin.equilibrium.lengths import STIFFEST
from twin.equilibrium.path import DIRECT, FOLLOWED, NOT_FOUND, Path
from twin.equilibrium.trial import Drive, run
from twin.errors import SolveError
from twin.robots import Body, available, hinge_pairs, load
from twin.springs.spring import Spring, no_springs

TOLERANCE = 1e-7  # rad in every hinge: the tip is then within 1e-4 mm

__all__ = [
    "DIRECT",
    "FOLLOWED",
    "NOT_FOUND",
    "TOLERANCE",
    "Antagonists",
    "Equilibrium",
    "Heating",
    "Path",
    "compile_solver",
    "is_compiled",
]


@dataclass(frozen=True)
class Heating:
    """SMA springs that pull the tendons `which` (n_tendon,), in surroundings at `ambient` (n,) K."""

    which: np.ndarray
    ambient: np.ndarray
    spring: Spring


class Equilibrium:
    """A compiled robot ready to be solved. Holds a MuJoCo model and data, so one instance serves one thread at a time."""

    def __init__(self, body: Body) -> None:
        self.model = model = body.spec.compile()
        self.data = data = mujoco.MjData(model)
        site = np.vectorize(lambda name: model.site(name).id, otypes=[np.int64])
        hole, disk = site(np.array(body.tendons)), site(np.array(body.disks))
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
            stiffening=float(body.stiffening),
            hand=np.linalg.det(model.jnt_axis[hinge > 0.0].reshape(-1, 3, 3)),
            body=moved_by,
            mass=model.body_subtreemass[moved_by].copy(),
            hole=hole,
            disk=disk,
            marker=site(np.array(list(body.markers.values()))),
            first=np.concatenate([[0], hinges[model.site_bodyid[disk]]]),
        )
        self.spring = model.qpos_spring.copy()
        mujoco.mj_kinematics(model, data)
        ends = data.site_xpos[hole]
        self.straight_path: np.ndarray = np.linalg.norm(np.diff(ends, axis=1), axis=2).sum(axis=1)  # (n_tendon,) m

    def solve(
        self, time: np.ndarray, command: np.ndarray, loads: Loads, route: Route | None = None, creep: Creep | None = None,
        delayed: np.ndarray | None = None, near: Path | None = None, keep: bool = False, tolerance: float = TOLERANCE,
        by_length: np.ndarray | None = None, stiffness: np.ndarray | None = None, once: bool = False,
        heating: Heating | None = None,
    ) -> Path:  # fmt: skip
        """Equilibria for commands (n, n_tendon) at times (n,) s, in the order of `twin.equilibrium.trial`.

        A command is a base tension in N, for the tendons of `by_length` (n_tendon,) a displacement in m, for those of `heating` a
        current in A that holds from one time to the next. `delayed` (n_element, nv) holds the creep strains and is advanced in
        place. `stiffness` (n,) scales the body's. `near`, a solution with LU of a neighbouring problem on the same samples, speeds
        the solve up; with `once` one Newton step a sample is taken from it. Where no equilibrium was found the sample's status is
        NOT_FOUND and its shape is the one before. Raises SolveError for held lengths of tendons that stiffen.
        """
        n, nt = command.shape
        nv = self.model.nv
        route, creep = route or Route(), creep or Creep()
        amplitude, retardation = np.array(creep.amplitude, float), np.array(creep.time, float)
        if delayed is None:
            delayed = np.zeros((amplitude.size, nv))
        by_length = np.zeros(nt, bool) if by_length is None else by_length
        if route.stiffening > 0.0 and by_length.any():
            raise SolveError(f"a length held by a tendon that stiffens ({route.stiffening:.3g} 1/N) is solved for antagonists only")
        heating = heating or Heating(np.zeros(nt, bool), np.zeros(n), no_springs(nt))
        drive = Drive(
            time=np.array(time, float),
            command=np.where(by_length, command, np.maximum(command, 0.0)),
            by_length=np.array(by_length, bool),
            straight=self.straight_path,
            stretch=float(route.stretch),
            least_stretch=STIFFEST,
            stiffness=np.ones(n) if stiffness is None else np.array(stiffness, float),
            by_spring=np.array(heating.which, bool),
            ambient=np.array(heating.ambient, float),
            spring=Spring(*(np.array(v, float) for v in heating.spring)),
        )
        out = Path(
            tension=np.empty((n, nt)),
            markers=np.empty((n, self.chain.marker.size, 3)),
            path=np.empty((n, nt)),
            q=np.empty((n, nv)),
            temperature=np.empty((n, nt)),
            status=np.empty(n, np.int64),
            started=0,
            slip=np.zeros((nt, self.chain.hole.shape[1] - 1)),
            distal=np.zeros((nt, self.chain.hole.shape[1] - 1)),
            LU=np.empty((n, nv, nv) if keep else (0, nv, nv)),
        )
        started = run(
            self.model._address,
            self.data._address,
            self.chain,
            self.spring,
            Law(float(route.mu), float(route.presliding), np.array(loads.wall, float)),
            Load(np.array(loads.gravity, float), float(loads.payload), np.array(loads.force, float)),
            amplitude,
            retardation,
            delayed,
            drive,
            near.q if near is not None else np.empty((0, nv)),
            near.tension if near is not None else np.empty((0, nt)),
            near.LU if near is not None else np.empty((0, nv, nv)),
            float(tolerance),
            keep,
            once,
            out.slip,
            out.distal,
            out.LU,
            out.q,
            out.tension,
            out.markers,
            out.path,
            out.temperature,
            out.status,
        )
        return replace(out, started=int(started))


def is_compiled() -> bool:
    """Whether the compiled solver lies in numba's disk cache, so that a first solve takes no seconds."""
    return bool(run.stats.cache_path) and any(File(run.stats.cache_path).glob("trial.run*.nbi"))


def compile_solver() -> None:
    """Compile the static solve (or load it from disk) by solving nothing."""
    bodies = (load(name).build() for name in available())
    solver = Equilibrium(next(body for body in bodies if "backbone" in body.parts))
    solver.solve(np.zeros(1), np.zeros((1, len(solver.chain.hole))), Loads(np.zeros(3)))
