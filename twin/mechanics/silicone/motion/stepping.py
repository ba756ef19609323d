"""Silicone bodies from step to step, among MuJoCo's contacts: the elasticity of the statics, tendons with friction, contacts.

    M (v+ - v) / h = -f(u) - b K v+ - sum_t T_t pull_t(u) + contacts,        u+ = u + h v+

Elastic force and the tendons' directions are those of the present shape; damping, the tensions of held tendons and the contacts are
those at the step's end (`damping.py`, `contact.py`). With b at least the step h, that is stable. MuJoCo gives all positions, the
contacts, and how contacts move with the nodes; rigid things it only carries on.

A tendon under a given tension is a force of that size; a held one is a stiff spring that only pulls. Friction's slip states follow
the travel from step to step.
"""

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit, jit_internal
from twin.mechanics.silicone.cables import trace_tendons
from twin.mechanics.silicone.material.damping import EffectiveMass, solve_transposed, solve_upper, update_mass
from twin.mechanics.silicone.material.law import LEAST_VOLUME_RATIO, forces
from twin.mechanics.silicone.motion.contact import RowLaw, solve_row_forces
from twin.mechanics.silicone.newton import BodyArrays, WorkArrays

DONE, INVERTED, LOST, UNBALANCED = 0, 1, 2, 3  # status of a step
SAME_PLACE = 1e-9  # m, within which two contacts are one
FASTEST_NODE = 1e3  # m/s; beyond it the motion counts as lost


@by_reference
class SteppedBody(NamedTuple):
    """A body that is stepped, and its coordinates in MuJoCo's model."""

    arrays: BodyArrays
    work: WorkArrays
    effective_mass: EffectiveMass
    dof: np.ndarray  # (nq,) coordinates
    held: np.ndarray  # (t,) whether a tendon is held
    stiffness: np.ndarray  # (t,) N/m, of held tendons
    hanging_path: np.ndarray  # (t,) m, from which lengths count
    slip: np.ndarray  # (t, p - 2) slip states
    distal: np.ndarray  # (t, p - 2) m, lengths distal of each inner point
    tension: np.ndarray  # (t,) N, of the last step
    force: np.ndarray  # (nq,) N, external, on the nodes
    mu: float
    presliding: float  # m


@by_reference
class EngineState(NamedTuple):
    """MuJoCo's coordinates and masses, and the body that each coordinate belongs to."""

    qpos: np.ndarray
    qvel: np.ndarray
    bias: np.ndarray  # (nv,)
    mass: np.ndarray  # (nv,) of the coordinates alone
    body: np.ndarray  # (nv,) index of the body, -1 for a thing
    index_in_body: np.ndarray  # (nv,) index within the body, or among the things' coordinates
    n_thing: int  # number of the things' coordinates
    step: float  # s


@by_reference
class Contacts(NamedTuple):
    """MuJoCo's contacts, three rows each, as sparse rows."""

    value: np.ndarray
    column: np.ndarray
    start: np.ndarray  # (n,)
    count: np.ndarray  # (n,)
    spring: np.ndarray  # (n, 4) stiffness, damping, impedance
    gap: np.ndarray  # (n,) m
    speed: np.ndarray  # (n,) m/s
    friction: np.ndarray  # (c,) coefficient of each contact
    impratio: float


@by_reference
class ConstraintRows(NamedTuple):
    """The held tendons, then the contacts, three rows each."""

    W: np.ndarray  # (n, n) 1/kg, inverse effective mass
    e: np.ndarray  # (n,) m/s, lags without force
    f: np.ndarray  # (n,) N
    law: RowLaw
    step: float  # s


class BodyStep(NamedTuple):
    """One body's part in a step: its status, its rows (m,), and columns (nq, 1 + m).

    The first column is the momentum at the step's end without the rows, the others are the rows' directions, all multiplied by
    U'^-1 of the effective mass.
    """

    status: int
    rows: np.ndarray
    columns: np.ndarray


def advance_speeds(bodies: Sequence[SteppedBody], engine: EngineState, contacts: Contacts, command: np.ndarray) -> tuple[int, int]:
    """Advance all speeds by a step under the commands (body, t), N or m. Return its status, and the index of the body at fault or
    -1."""
    held = [int(body.held.sum()) for body in bodies]
    n = sum(held) + len(contacts.gap)
    law = RowLaw(np.zeros(n), sum(held), contacts.friction)
    rows = ConstraintRows(np.zeros((n, n)), np.zeros(n), np.zeros(n), law, engine.step)
    steps, first = [], [0, *accumulate(held)]
    for k, body in enumerate(bodies):
        steps.append(BodyStep(*body_step(body, k, engine, contacts, command[k], first[k], rows)))
        if steps[k].status != DONE:
            return steps[k].status, k
    if not solve_rows(engine, contacts, rows):
        return UNBALANCED, -1
    for k, body in enumerate(bodies):
        if not finish_body(body, engine, steps[k], rows.f, first[k]):
            return LOST, k
    return DONE, -1


@jit
def body_step(body, k, engine, contacts, command, first, rows):
    """Compute body k's part in a step, its tendons' rows from `first` on, and add its share to the rows."""
    n_tendon_row = rows.law.n_tendon_row
    own = own_rows(body, k, engine, contacts, first, n_tendon_row)
    columns = np.zeros((body.dof.size, 1 + own.size))
    if not update_forces(body, engine.qpos):
        return INVERTED, own, columns
    row = first
    for t in range(body.held.size):
        add_tendon(body, t, command[t], row, 1 + row - first, rows, columns)
        row += body.held[t]
    fill_momentum(body, k, engine, contacts, n_tendon_row, own, columns)
    update_mass(body.effective_mass, body.arrays.cells, body.work.all_nodes)
    solve_transposed(body.effective_mass, columns)
    both = np.dot(columns.T, columns)
    if not np.isfinite(both.sum()):
        return LOST, own, columns
    for i in range(own.size):
        rows.e[own[i]] += both[1 + i, 0]
        for j in range(own.size):
            rows.W[own[i], own[j]] += both[1 + i, 1 + j]
    return DONE, own, columns


@jit
def unique_contacts(pos, geom, flex):
    """Return the indices of contacts at distinct places (n, 3) m between geometries and flexes (n, 2): the first at each."""
    kept, count = np.empty(pos.shape[0], np.int64), 0
    for i in range(pos.shape[0]):
        new = True
        for k in range(count):
            j = kept[k]
            near = max(abs(pos[i, 0] - pos[j, 0]), abs(pos[i, 1] - pos[j, 1]), abs(pos[i, 2] - pos[j, 2])) < SAME_PLACE
            same = geom[i, 0] == geom[j, 0] and geom[i, 1] == geom[j, 1] and flex[i, 0] == flex[j, 0] and flex[i, 1] == flex[j, 1]
            new = new and not (near and same)
        if new:
            kept[count] = i
            count += 1
    return kept[:count]


@jit
def solve_rows(engine, contacts, rows):
    """Solve the rows' forces, and advance the things' speeds. Return False where no forces are found."""
    add_things(engine, contacts, rows)
    set_contact_rows(contacts, rows)
    if rows.f.size > 0 and not solve_row_forces(rows.law, engine.step * rows.W, rows.e, rows.f):
        return False
    advance_things(engine, contacts, rows)
    return True


@jit
def update_forces(body, qpos):
    """Fill work.f with the elastic force, and work.tendons. Return False where a cell is inverted."""
    work, arrays = body.work, body.arrays
    u = work.all_nodes[arrays.clamped :]
    for a in range(body.dof.size):
        u[a // 3, a % 3] = qpos[body.dof[a]]
    if not forces(work.all_nodes, arrays.cells, work.relaxed, work.f, work.pressure) >= LEAST_VOLUME_RATIO:
        return False
    trace_tendons(arrays.cables, u, body.slip, body.distal, body.mu, body.presliding, work.tendons)
    return True


@jit_internal
def own_rows(body, k, engine, contacts, first, n_tendon_row):
    """Return the rows that act on body k: its held tendons, from `first` on, and its contacts."""
    count, own = body.held.sum(), np.empty(body.held.size + contacts.gap.size, np.int64)
    for i in range(count):
        own[i] = first + i
    for r in range(contacts.gap.size):
        for i in range(contacts.start[r], contacts.start[r] + contacts.count[r]):
            if engine.body[contacts.column[i]] == k:
                own[count] = n_tendon_row + r
                count += 1
                break
    return own[:count]


@jit_internal
def add_tendon(body, t, command, row, column, rows, columns):
    """Add tendon t under its command (N or m): a given force, or a spring's row and column."""
    tendons, nq, h = body.work.tendons, body.dof.size, rows.step
    body.slip[t] = tendons.slip[t]
    body.distal[t] = tendons.distal[t]
    if body.held[t]:
        rows.law.D[row] = body.stiffness[t] * h
        rows.e[row] -= (tendons.path[t] - body.hanging_path[t] + command) / h
        rows.f[row] = body.tension[t]
        for a in range(nq):
            columns[a, column] = -tendons.pull[t, a]
    else:
        body.tension[t] = max(0.0, command)
        for a in range(nq):
            body.work.f[a] += body.tension[t] * tendons.pull[t, a]


@jit_internal
def fill_momentum(body, k, engine, contacts, n_tendon_row, own, columns):
    """Fill the momentum at the step's end without the rows, and the directions of the contacts' rows."""
    h = engine.step
    for a in range(body.dof.size):
        d = body.dof[a]
        force = body.force[a] - body.work.f[a] - engine.bias[d]
        columns[a, 0] = body.effective_mass.mass[a] * engine.qvel[d] + h * force
    for i in range(own.size):
        r = own[i] - n_tendon_row
        if r >= 0:
            for j in range(contacts.start[r], contacts.start[r] + contacts.count[r]):
                if engine.body[contacts.column[j]] == k:
                    columns[engine.index_in_body[contacts.column[j]], 1 + i] = contacts.value[j]


@jit_internal
def add_things(engine, contacts, rows):
    """Add the things' share to the rows: inverse mass, and speeds at the step's end without contact."""
    n_tendon_row, columns = rows.law.n_tendon_row, np.zeros((rows.e.size, engine.n_thing))
    for r in range(contacts.gap.size):
        for i in range(contacts.start[r], contacts.start[r] + contacts.count[r]):
            d = contacts.column[i]
            if engine.body[d] < 0:
                free = engine.qvel[d] - engine.step * engine.bias[d] / engine.mass[d]
                rows.e[n_tendon_row + r] += contacts.value[i] * free
                columns[n_tendon_row + r, engine.index_in_body[d]] = contacts.value[i] / np.sqrt(engine.mass[d])
    rows.W[:] += np.dot(columns, columns.T)


@jit_internal
def set_contact_rows(contacts, rows):
    """Set D of the contacts, and subtract their target speeds from their lags."""
    n_tendon_row, D, h = rows.law.n_tendon_row, rows.law.D, rows.step
    for r in range(contacts.gap.size):
        damping, impedance = contacts.spring[r, 1], contacts.spring[r, 2]
        spring, own, normal = contacts.spring[r, 0] * impedance, n_tendon_row + r, n_tendon_row + r - r % 3
        hard = 1.0 / h + damping + h * spring
        rows.e[own] -= (contacts.speed[r] / h - spring * contacts.gap[r]) / hard
        D[own] = contacts.impratio * D[normal] if r % 3 else hard * impedance / ((1.0 - impedance) * rows.W[own, own])


@jit_internal
def advance_things(engine, contacts, rows):
    """Set the things' speeds at the step's end."""
    for d in range(engine.mass.size):
        if engine.body[d] < 0:
            engine.qvel[d] -= engine.step * engine.bias[d] / engine.mass[d]
    for r in range(contacts.gap.size):
        for i in range(contacts.start[r], contacts.start[r] + contacts.count[r]):
            d = contacts.column[i]
            if engine.body[d] < 0:
                engine.qvel[d] += engine.step * contacts.value[i] * rows.f[rows.law.n_tendon_row + r] / engine.mass[d]


@jit
def finish_body(body, engine, step, f, row):
    """Set the nodes' speeds and the tensions of held tendons. Return False where a node has no finite position or speed."""
    v = step.columns[:, 0].copy()
    for i in range(step.rows.size):
        for a in range(v.size):
            v[a] += engine.step * f[step.rows[i]] * step.columns[a, 1 + i]
    solve_upper(body.effective_mass, v)
    for a in range(v.size):
        d = body.dof[a]
        if not (abs(v[a]) < FASTEST_NODE and abs(engine.qpos[d]) < FASTEST_NODE):
            return False
        engine.qvel[d] = v[a]
    for t in range(body.held.size):
        if body.held[t]:
            body.tension[t] = f[row]
            row += 1
    return True
