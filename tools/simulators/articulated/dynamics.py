"""Integrates Lagrange's equations of a planar chain of hinges with springs, tendons, servos and friction.

    M(q) q'' + c(q, q') + D q' + dV/dq = sum_i sum_m T_im (-dl_im/dq) + servos + friction
    M_jk = sum_{i >= j, k} m_i (c_i - p_j) . (c_i - p_k) + I_i (+ armature_j for j = k)
    tau_j = sense sum_{i >= j} m_i cross(c_i - p_j, g - b_i),    b_i = acceleration of c_i at q'' = 0
    T_im = T_i exp(-mu_i sum_{k <= m} theta_ik z_ik) on the piece after via m,    T_i = [kp (l - u) + kv l'] within (0, limit)

Friction is Dahl's (1968): sticking z runs to +-1 over a travel `give`, z+ = s + (z - s) exp(-|travel| / give), s = sign of travel,
which solves his equation exactly for any step. Angles live at the half steps, speeds at the full ones (leapfrog):

    q_{n+1/2} = q_{n-1/2} + h w_n,    (M - h/2 A) (w_{n+1} - w_n) = h [f(q_{n+1/2}, w*) + A (w_n - w*)]

with A ~ df/dw and w* the speed extrapolated to the half step: second order in h, damping implicit, stable while h < 2 / omega of
the stiffest spring, 3.2e-4 s for the finger's joint stops. The default step is a third of that, and a tenth of that of everything
that moves without a stop; the error against half the step is tested.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.simulators.articulated.plant import Chain, Commands, Plant, Rubbing, Tendons

STEP = 1e-4  # s
SETTLE = 2.0  # s at the first command before the log


class State(NamedTuple):
    """Everything that has a past. `seg` holds direction and length of each piece after its via, and from there to the end."""

    q: np.ndarray
    w: np.ndarray
    stuck: np.ndarray  # per joint
    slid: np.ndarray  # per via
    seg: np.ndarray  # (vias, 4)
    drum: np.ndarray  # m of tendon paid out, per tendon with compliance
    heard: np.ndarray  # command that the drive follows
    tip: np.ndarray  # (4,) position before and the brush's bend


class Work(NamedTuple):
    """What a step fills anew: frames, equations M and A and f, a tendon's dl/dq, speeds at the half step, torques and tendons."""

    frame: np.ndarray  # (n + 2, 4)
    M: np.ndarray
    A: np.ndarray
    f: np.ndarray
    grow: np.ndarray
    felt: np.ndarray
    w: np.ndarray
    torque: np.ndarray
    drives: np.ndarray  # (2, tendons): tension at the winch, length at the drum


@njit(cache=True)
def place(chain: Chain, q: np.ndarray, frame: np.ndarray) -> None:
    """Fill frame (n + 2, 4) with cosine, sine and origin x, z: of the base, of each link, and of the tip."""
    n = len(q)
    angle, x, z = 0.0, 0.0, 0.0
    frame[0, 0], frame[0, 1], frame[0, 2], frame[0, 3] = 1.0, 0.0, 0.0, 0.0
    for k in range(n):
        angle += chain.sense * q[k]
        c, s = np.cos(angle), np.sin(angle)
        frame[k + 1, 0], frame[k + 1, 1], frame[k + 1, 2], frame[k + 1, 3] = c, s, x, z
        x += chain.length[k] * c
        z += chain.length[k] * s
    frame[n + 1, 0], frame[n + 1, 1], frame[n + 1, 2], frame[n + 1, 3] = c, s, x, z


@njit(cache=True)
def inertial(chain: Chain, frame: np.ndarray, w: np.ndarray, M: np.ndarray, f: np.ndarray) -> None:
    """Fill the mass matrix and the torques of gravity and of centrifugal and Coriolis acceleration."""
    n = len(w)
    M[:] = 0.0
    f[:] = 0.0
    spin, bx, bz = 0.0, 0.0, 0.0
    for i in range(n):
        spin += w[i]
        c, s = frame[i + 1, 0], frame[i + 1, 1]
        rx, rz, m = chain.com[i] * c, chain.com[i] * s, chain.mass[i]
        ax, az = chain.gravity[0] - bx + spin * spin * rx, chain.gravity[1] - bz + spin * spin * rz
        for j in range(i + 1):
            dx, dz = frame[i + 1, 2] + rx - frame[j + 1, 2], frame[i + 1, 3] + rz - frame[j + 1, 3]
            f[j] += chain.sense * m * (dx * az - dz * ax)
            for k in range(i + 1):
                ex, ez = frame[i + 1, 2] + rx - frame[k + 1, 2], frame[i + 1, 3] + rz - frame[k + 1, 3]
                M[j, k] += m * (dx * ex + dz * ez) + chain.inertia[i]
        bx -= spin * spin * chain.length[i] * c
        bz -= spin * spin * chain.length[i] * s
    for j in range(n):
        M[j, j] += chain.armature[j]


@njit(cache=True)
def via_point(tendons: Tendons, frame: np.ndarray, m: int) -> tuple[float, float]:
    """Return x, z of a via point."""
    k = tendons.link[m] + 1
    c, s = frame[k, 0], frame[k, 1]
    return frame[k, 2] + c * tendons.x[m] - s * tendons.z[m], frame[k, 3] + s * tendons.x[m] + c * tendons.z[m]


@njit(cache=True)
def route(tendons: Tendons, i: int, frame: np.ndarray, state: State) -> float:
    """Find directions and lengths of a tendon's pieces, and let it slide through its via points; return its length."""
    first, last = tendons.first[i], tendons.first[i + 1] - 1
    x, z = via_point(tendons, frame, first)
    total = 0.0
    for m in range(first, last):
        x2, z2 = via_point(tendons, frame, m + 1)
        length = np.sqrt((x2 - x) ** 2 + (z2 - z) ** 2)
        state.seg[m, 0], state.seg[m, 1], state.seg[m, 2] = (x2 - x) / length, (z2 - z) / length, length
        x, z = x2, z2
        total += length
    if tendons.mu[i] > 0.0:
        beyond = 0.0
        for m in range(last - 1, first, -1):
            beyond += state.seg[m, 2]
            travel = state.seg[m, 3] - beyond  # towards the winch
            side = 1.0 if travel > 0.0 else -1.0
            state.slid[m] = side + (state.slid[m] - side) * np.exp(-abs(travel) / tendons.slip)
            state.seg[m, 3] = beyond
    return total


@njit(cache=True)
def shares(chain: Chain, tendons: Tendons, i: int, state: State, work: Work) -> None:
    """Fill dl/dq of a tendon, and the same with each piece weighted by the share of the winch's tension that reaches it."""
    first, last = tendons.first[i], tendons.first[i + 1] - 1
    frame, grow, felt = work.frame, work.grow, work.felt
    grow[:] = 0.0
    felt[:] = 0.0
    exponent = 0.0
    for m in range(first, last):
        ex, ez = state.seg[m, 0], state.seg[m, 1]
        if m > first and tendons.mu[i] > 0.0:
            ox, oz = state.seg[m - 1, 0], state.seg[m - 1, 1]
            exponent += abs(np.arctan2(ox * ez - oz * ex, ox * ex + oz * ez)) * state.slid[m]
        share = np.exp(-tendons.mu[i] * exponent)
        x, z = via_point(tendons, frame, m + 1)
        for j in range(tendons.link[m] + 1, tendons.link[m + 1] + 1):
            rate = chain.sense * ((x - frame[j + 1, 2]) * ez - (z - frame[j + 1, 3]) * ex)
            grow[j] += rate
            felt[j] += share * rate


@njit(cache=True)
def tension(
    tendons: Tendons, i: int, length: float, rate: float, command: float, drum: np.ndarray, h: float
) -> tuple[float, float, bool]:
    """Return tension, length at the drum and whether the winch's damping acts on the joints; moves the drum behind a compliance."""
    kp, kv, c = tendons.kp[i], tendons.kv[i], tendons.compliance[i]
    if c == 0.0:
        pull = kp * (length - command) + kv * rate
        return tendons.gain[i] * min(max(pull, 0.0), tendons.limit[i]), length, 0.0 < pull < tendons.limit[i]
    taut = length > drum[i]
    stiff = kp + (1.0 / c if taut else 0.0)
    target = (kp * command + (length / c if taut else 0.0)) / stiff
    drum[i] = target + (drum[i] - target) * np.exp(-h * stiff / kv)
    pull = min(max((length - drum[i]) / c, 0.0), tendons.limit[i])
    return tendons.gain[i] * pull, length - c * pull, False


@njit(cache=True)
def pull_tendons(plant: Plant, state: State, work: Work, h: float) -> None:
    """Add the tendons' torques, and keep tension at the winch and length at the drum."""
    n, grow, felt, f, A = len(work.w), work.grow, work.felt, work.f, work.A
    for a in range(len(plant.commands.tendon)):
        i = plant.commands.tendon[a]
        if i < 0:
            continue
        length = route(plant.tendons, i, work.frame, state)
        shares(plant.chain, plant.tendons, i, state, work)
        rate = 0.0
        for j in range(n):
            rate += grow[j] * work.w[j]
        pull, wound, damped = tension(plant.tendons, i, length, rate, state.heard[a], state.drum, h)
        work.drives[0, i], work.drives[1, i] = pull, wound
        for j in range(n):
            f[j] -= pull * felt[j]
            if damped:
                for k in range(n):
                    A[j, k] -= plant.tendons.gain[i] * plant.tendons.kv[i] * felt[j] * grow[k]


@njit(cache=True)
def turn_servos(plant: Plant, state: State, work: Work) -> None:
    """Add the servos' torques."""
    servos, w, torque = plant.servos, work.w, work.torque
    for a in range(len(plant.commands.joint)):
        j = plant.commands.joint[a]
        if j >= 0:
            asked = servos.kp[j] * (state.heard[a] - state.q[j]) - servos.kv[j] * w[j]
            torque[j] = servos.gain[j] * min(max(asked, -servos.limit[j]), servos.limit[j])
            work.f[j] += torque[j]
            if abs(asked) < servos.limit[j]:
                work.A[j, j] -= servos.gain[j] * servos.kv[j]


@njit(cache=True)
def hinge(chain: Chain, rubbing: Rubbing, state: State, work: Work, h: float) -> None:
    """Add springs, damping, stops, detents and friction of the joints."""
    w, f, A = work.w, work.f, work.A
    for j in range(len(w)):
        q = state.q[j]
        f[j] -= chain.stiffness[j] * (q - chain.rest[j]) + (chain.damping[j] + chain.drag[j] * abs(w[j])) * w[j]
        A[j, j] -= chain.damping[j] + 2.0 * chain.drag[j] * abs(w[j])
        for side in (-1.0, 1.0):
            into = q - chain.high[j] if side > 0.0 else chain.low[j] - q
            push = chain.stop[0] * into + chain.stop[1] * side * w[j]
            if into > 0.0 and push > 0.0:
                f[j] -= side * push
                A[j, j] -= chain.stop[1]
        f[j] -= rubbing.detent[j] * np.sin(rubbing.teeth[j] * q + rubbing.phase[j])
        level = rubbing.coulomb[j] + rubbing.load[j] * abs(work.torque[j])
        if level > 0.0:
            travel = h * state.w[j]
            side = 1.0 if travel > 0.0 else -1.0
            state.stuck[j] = side + (state.stuck[j] - side) * np.exp(-abs(travel) / rubbing.give)
            level *= 1.0 + rubbing.stribeck[j] * np.exp(-((w[j] / rubbing.speed) ** 2))
            f[j] -= level * state.stuck[j]


@njit(cache=True)
def brush(chain: Chain, rubbing: Rubbing, tip: np.ndarray, work: Work) -> None:
    """Add the drag of a brush on the tip, full below its edge, against the direction of travel."""
    n, frame, f = len(work.f), work.frame, work.f
    x, z = frame[n + 1, 2], frame[n + 1, 3]
    dx, dz = x - tip[0], z - tip[1]
    far = np.sqrt(dx * dx + dz * dz)
    if far > 0.0:
        left = np.exp(-far / rubbing.brush_give)
        tip[2] = dx / far + (tip[2] - dx / far) * left
        tip[3] = dz / far + (tip[3] - dz / far) * left
    tip[0], tip[1] = x, z
    force = rubbing.brush[0] / (1.0 + np.exp((z - rubbing.brush[1]) / rubbing.brush[2]))
    for j in range(n):
        f[j] -= chain.sense * force * ((x - frame[j + 1, 2]) * tip[3] - (z - frame[j + 1, 3]) * tip[2])


@njit(cache=True)
def solve(M: np.ndarray, b: np.ndarray) -> None:
    """Solve M x = b in place, small and diagonally dominant enough for no pivoting; b becomes x."""
    n = len(b)
    for i in range(n):
        for k in range(i + 1, n):
            part = M[k, i] / M[i, i]
            for j in range(i, n):
                M[k, j] -= part * M[i, j]
            b[k] -= part * b[i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= M[i, j] * b[j]
        b[i] /= M[i, i]


@njit(cache=True)
def listen(commands: Commands, asked: np.ndarray, h: float, state: State) -> None:
    """Let the drives hear their commands: shifted by a zero, through play, after a lag."""
    for a in range(len(asked)):
        wanted, half = asked[a] + commands.zero[a], 0.5 * commands.play[a]
        if half > 0.0:
            wanted = min(max(state.heard[a], wanted - half), wanted + half)
        lag = commands.lag[a]
        state.heard[a] = wanted + (state.heard[a] - wanted) * np.exp(-h / lag) if lag > 0.0 else wanted


@njit(cache=True)
def advance(plant: Plant, state: State, work: Work, h: float) -> None:
    """Move the speeds on by one step from the angles at its middle; `work.w` goes in and comes out extrapolated to the middle."""
    n, M, A, f, w = len(state.q), work.M, work.A, work.f, work.w
    place(plant.chain, state.q, work.frame)
    inertial(plant.chain, work.frame, w, M, f)
    A[:] = 0.0
    pull_tendons(plant, state, work, h)
    turn_servos(plant, state, work)
    hinge(plant.chain, plant.rubbing, state, work, h)
    if plant.rubbing.brush[0] > 0.0:
        brush(plant.chain, plant.rubbing, state.tip, work)
    for j in range(n):
        for k in range(n):
            f[j] += A[j, k] * (state.w[k] - w[k])
    for j in range(n):
        f[j] *= h
        for k in range(n):
            M[j, k] -= 0.5 * h * A[j, k]
    solve(M, f)
    for j in range(n):
        state.w[j] += f[j]
        w[j] = state.w[j] + 0.5 * f[j]


@njit(cache=True)
def march(plant: Plant, state: State, command: np.ndarray, every: float, settle: float, h: float) -> np.ndarray:
    """Integrate through a log; rows (logs, 2 n + 2 + 2 tendons): angles, servo torques, tip x, z, tensions, lengths at the drum."""
    n, t, logs = len(state.q), len(plant.tendons.kp), len(command)
    square, line = np.zeros((2, n, n)), np.zeros((4, n))
    frame, drives = np.zeros((n + 2, 4)), np.zeros((2, t))
    work = Work(frame, square[0], square[1], line[0], line[1], line[2], state.w.copy(), line[3], drives)
    rows, now, asked = np.zeros((logs, 2 * n + 2 + 2 * t)), np.zeros(2 * n + 2 + 2 * t), command[0].copy()
    before, done = now.copy(), 0
    for step in range(int((settle + (logs + 1) * every) / h)):
        time = (step + 0.5) * h - settle
        for j in range(n):
            state.q[j] += h * state.w[j]
        at = min(max(time / every, 0.0), logs - 1.0)
        row = min(int(at), logs - 2)
        for a in range(len(asked)):
            asked[a] = command[row, a] + (at - row) * (command[row + 1, a] - command[row, a])
        listen(plant.commands, asked, h, state)
        advance(plant, state, work, h)
        before[:] = now
        now[:n], now[n : 2 * n], now[2 * n : 2 * n + 2] = state.q, work.torque, frame[n + 1, 2:]
        now[2 * n + 2 : 2 * n + 2 + t], now[2 * n + 2 + t :] = drives[0], drives[1]
        if step == 0:
            before[:] = now
        while done < logs and done * every - plant.delay <= time:
            part = (time - (done * every - plant.delay)) / h
            rows[done] = now + part * (before - now)
            done += 1
    return rows


def rest_state(plant: Plant, q: np.ndarray, command: np.ndarray) -> State:
    """Return the robot at rest in a pose, with its drives at a command and nothing yet rubbed."""
    n, vias, tendons = len(q), len(plant.tendons.x), len(plant.tendons.kp)
    frame, drum = np.zeros((n + 2, 4)), np.zeros(tendons)
    place(plant.chain, q, frame)
    tip = np.array([frame[-1, 2], frame[-1, 3], 0.0, 0.0])
    state = State(
        np.array(q, dtype=float), np.zeros(n), np.zeros(n), np.zeros(vias), np.zeros((vias, 4)), drum, command.copy(), tip
    )
    for i in range(tendons):
        drum[i] = route(plant.tendons, i, frame, state)
        for m in range(plant.tendons.first[i + 1] - 2, plant.tendons.first[i], -1):
            state.seg[m, 3] = state.seg[m, 2] + state.seg[m + 1, 3]
    state.slid[:] = 0.0
    return state
