"""The next experiment: the one trial, from a menu that the robot can run, that best separates the two best explanations.

T-optimality (Atkinson and Fedorov 1975): with both models fitted to the present data, T = min over B's parameters, held by their
present covariance, of |W (y_A - y_B)|^2; T = 25 separates them by five standard errors.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from twin.body import Drive, Loads
from twin.diagnosis.calibration.fisher_information import solve
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.objective import Evaluation, Objective
from twin.diagnosis.checks.zero_jumps import of_robot
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.diagnosis.thresholds import (
    CLEAR_CHI_SQUARE,
    HEAVIEST_PAYLOAD,
    HELD_COMMAND_SHARE,
    LEAST_PAYLOAD,
    MOST_REPEATS,
    SLOW_TRIAL,
)
from twin.foundation.errors import SolveError
from twin.measurements import Channel
from twin.prediction.prepared import Inputs, Output, PreparedRecording

_Apart = tuple[str, Inputs, Objective, Evaluation, np.ndarray]  # a trial of the menu, the rival's prediction, the difference


@dataclass(frozen=True)
class Experiment:
    """A trial in words and as commands, with its power to separate two sets of effects.

    `separation`: T of one run. `repeats`: how many runs reach T = 25. `between`: the two sets of effects.
    """

    words: str
    trial: Inputs
    separation: float
    repeats: int
    between: tuple[tuple[str, ...], tuple[str, ...]]


def menu(prepared: PreparedRecording) -> list[tuple[str, Inputs]]:
    """Return trials that this robot could run, within the commands already used.

    The payload is up to three times as large, at most 30 g; the load torque of a jaw from none to the largest. Controls of an MJCF
    go from where they rest, for as long as the longest trial. Springs heated by currents cool within a minute and would not respond
    to a fast pull.
    """
    n, like = prepared.n_tendon, prepared.inputs[0]
    slow = SLOW_TRIAL
    if Drive.CONTROL in prepared.drives:
        slow = min(slow, max(float(np.ptp(i.time)) for i in prepared.inputs))
    home, top = _from_and_to(prepared)
    shapes: list[tuple[str, np.ndarray, np.ndarray]] = []

    def add(label: str, duration: float, command: np.ndarray) -> None:
        shapes.append((label, np.linspace(0.0, duration, len(command)), home + command))

    up_down = np.concatenate([np.linspace(0, 1, 30), np.linspace(1, 0, 30)])
    up_half_up_down = np.interp(np.arange(120), [0, 40, 60, 80, 119], [0.0, 1.0, 0.5, 1.0, 0.0])
    hold = np.concatenate([[0.0], np.full(60, HELD_COMMAND_SHARE)])
    for move in _motor_moves(prepared) or _moves(prepared, home, top):
        fast = min(move.fast, 0.1 * slow) if like.home is not None else move.fast
        to, whole = f"{move.words} to {move.to}", move.command
        add(f"{to} and release it, slowly ({slow:.0f} s)", slow, np.outer(up_down, whole))
        add(f"{to} and release it, fast ({fast:.2g} s)", fast, np.outer(up_down, whole))
        again = f"{to}, release it to half, pull it again and release it, slowly ({2.0 * slow:.0f} s)"
        add(again, 2.0 * slow, np.outer(up_half_up_down, whole))
        add(f"step {move.what} to three quarters of {move.to} and hold for {slow:.0f} s", slow, np.outer(hold, whole))
    turns = np.linspace(0, 4 * np.pi, 80)
    circle = [0.6 * np.maximum(0.0, 0.5 + 0.5 * np.cos(turns - 2 * np.pi * j / n)) for j in range(n)]
    if not prepared.driven_by(Drive.DISPLACEMENT).any() and top.all() and like.home is None:
        all_to = f"two circles with all tendons up to 0.6 of {_worded(prepared, 0, top[0])} ({4.0 / 3.0 * slow:.0f} s)"
        add(all_to, 4.0 / 3.0 * slow, top * np.stack(circle, axis=1))
    add(f"rest unloaded for {0.5 * slow:.0f} s", 0.5 * slow, np.zeros((30, n)))
    last = max(float(i.clock[-1]) for i in prepared.inputs) + 60.0
    out = []
    for load, loads in _loads(prepared):
        for motion, time, command in shapes:
            warm = np.full(len(time), like.temperature[0])
            own = {"time": time, "clock": last + time, "command": command, "temperature": warm, "loads": loads, "clouds": None}
            out.append((f"{motion}, {load}", replace(like, name=f"{motion}, {load}", swing=None, **own)))
    return out


@dataclass(frozen=True)
class _Move:
    """A move of one drive: in words, how far, how long a fast one takes (s), and its change of all commands (n_drive,)."""

    what: str
    words: str
    to: str
    fast: float
    command: np.ndarray


def _moves(prepared: PreparedRecording, home: np.ndarray, top: np.ndarray) -> list[_Move]:
    """Return the moves of each drive.

    Where displacements are commanded, the other tendons are let out, so that they are slack; rods by as much together as the one
    that pulls is drawn in.
    """
    held, out = prepared.driven_by(Drive.DISPLACEMENT), list[_Move]()
    let_out = -1.0 / max(prepared.n_tendon - 1, 1) if prepared.pushes else -1.0
    for i in np.flatnonzero(top - home):  # what was never commanded has no range
        alone = np.arange(prepared.n_tendon) == i
        command = (top - home) * np.where(held & ~alone, let_out, alone)
        out.append(_Move(*_deed(prepared, int(i)), command))
    return out


def _motor_moves(prepared: PreparedRecording) -> list[_Move]:
    """Return the moves of each motor whose angle drives, to the farthest angle commanded; none where others drive too.

    Other motors stay at zero if they wind antagonists, and let out a tendon that they wind alone.
    """
    names = [c.name for c in prepared.drivers]
    if not (prepared.driven_by(Drive.DISPLACEMENT) & (prepared.pull != 1.0)).all():
        return []
    out, every = [], np.concatenate([i.command for i in prepared.inputs])
    single = np.array([names.count(n) == 1 for n in names])
    for name in dict.fromkeys(names):
        t, own = names.index(name), np.array([n == name for n in names])
        angle = every[:, t] / prepared.pull[t]
        farthest = (
            float(angle[np.abs(angle).argmax()]) if own.sum() > 1 else float(np.max(every[:, t], initial=0.0) / prepared.pull[t])
        )
        command = farthest * np.where(own, prepared.pull, 0.0)
        out_by = np.max(np.abs(command))
        unit = prepared.drivers[t].unit_scale.without_offset().from_si(np.array([farthest]))[0]
        to = f"{_shown(abs(unit)) if unit >= 0 else '-' + _shown(abs(unit))} {prepared.drivers[t].unit}"
        if farthest:
            out.append(_Move(name, f"turn {name}", to, 4.0, np.where(single & ~own, -out_by, command)))
    return out


def _from_and_to(prepared: PreparedRecording) -> tuple[np.ndarray, np.ndarray]:
    """Return where commands (n_drive,) begin, controls where they rest, pulls at zero, and the farthest that they go."""
    like, n = prepared.inputs[0], prepared.n_tendon
    every = np.concatenate([i.command for i in prepared.inputs])
    if like.home is not None:
        return like.home, every[np.abs(every - like.home).argmax(axis=0), np.arange(n)]
    top, held = every.max(axis=0), prepared.driven_by(Drive.DISPLACEMENT)
    return np.zeros(n), np.where(held, np.max(top[held], initial=0.0), np.max(top[~held], initial=0.0))


def _loads(prepared: PreparedRecording) -> list[tuple[str, Loads]]:
    """Return the loads of the menu in words and numbers."""
    bare = replace(prepared.inputs[0].loads, force=np.zeros(3))
    if "torque" in prepared.robot.build().load_channels.values():
        torques = [float(np.mean(i.loads.torque)) for i in prepared.inputs]
        least, most = min(torques), max(torques)
        return [(f"load torque {x:.3g} N m", replace(bare, torque=np.full(1, x))) for x in (0.0, 0.5 * least, least, most)]
    heaviest = max(i.loads.payload for i in prepared.inputs)
    payloads = sorted({0.0, min(HEAVIEST_PAYLOAD, max(LEAST_PAYLOAD, 3.0 * heaviest))})
    return [(f"tip payload {1e3 * m:.0f} g", replace(bare, payload=m)) for m in payloads]


def _deed(prepared: PreparedRecording, i: int) -> tuple[str, str, str, float]:
    """Return what a move is of, its words, how far it goes in words, and how long a fast one takes (s)."""
    to = _worded(prepared, i, float(_from_and_to(prepared)[1][i]))
    if prepared.drives[i] is Drive.CURRENT:
        return f"spring {i + 1}", f"heat spring {i + 1} with up", to, 40.0
    if prepared.drives[i] is Drive.CONTROL:
        name = prepared.drivers[i].name
        return name, f"move {name}", to, 4.0
    return f"tendon {i + 1}", f"pull tendon {i + 1}", to, 4.0


def _worded(prepared: PreparedRecording, i: int, command: float) -> str:
    """Return a command with its unit."""
    if prepared.drives[i] is Drive.CONTROL:
        return f"{command:.3g} {prepared.drivers[i].si_unit}"
    unit, factor = prepared.drives[i].display_unit
    return f"{_shown(factor * command)} {unit}"


def _shown(x: float) -> str:
    return f"{x:.1f}" if x >= 1.0 else f"{x:.2g}"


def next_experiment(prepared: PreparedRecording, noise: Noise, a: Fit, b: Fit, jobs: int) -> Experiment | None:
    """Return the trial of the menu that best separates the rival `b` from the claimed `a`; None where no trial helps."""
    rivals = tuple(e.id for e in of_robot(a.model.twin.effects)), tuple(e.id for e in of_robot(b.model.twin.effects))
    prepared, noise = _foreseen(prepared, noise)

    def predicted(words: str, inputs: Inputs) -> _Apart | None:
        n = len(inputs.time)
        empty = np.zeros((n, len(prepared.outputs)))
        imagined = replace(prepared, inputs=(inputs,), measured=(empty,))
        exact = replace(noise, drive=np.zeros(prepared.n_tendon))
        whitener = Whitener(exact, [empty], [np.zeros((n, len(prepared.outputs), prepared.n_tendon))], [inputs.command])
        objective = Objective(imagined, [0], whitener, jobs)
        try:
            at = objective.evaluate(b.model)
            return words, inputs, objective, at, objective.evaluate(a.model, at.traces).z - at.z
        except SolveError:
            return None

    found: Any = Parallel(n_jobs=jobs, prefer="threads", require="sharedmem")(
        delayed(predicted)(*trial) for trial in menu(prepared)
    )
    # Keep one of several trials to which the robot responds alike (a load without gravity, a rate without a time effect).
    alike: dict[bytes, _Apart] = {}
    for trial in found:
        if trial is not None:
            alike.setdefault(trial[3].z.tobytes() + trial[4].tobytes(), trial)
    apart = list(alike.values())
    best: Experiment | None = None
    for words, inputs, objective, at, d in sorted(apart, key=lambda trial: -float(trial[-1] @ trial[-1])):
        if best is not None and float(d @ d) <= best.separation:  # b's imitation can only reduce it
            break
        try:
            T = _separation(objective, b, at, d)
        except SolveError:  # a neighbour of b has no equilibrium there: not a trial to recommend
            continue
        if best is None or best.separation < T:
            best = Experiment(words, inputs, T, max(1, int(np.ceil(CLEAR_CHI_SQUARE / max(T, 1e-9)))), rivals)
    return best if best is not None and best.repeats <= MOST_REPEATS else None


def _foreseen(prepared: PreparedRecording, noise: Noise) -> tuple[PreparedRecording, Noise]:
    """Return the recording with the tip in place of patches of skin, and its noise model.

    Which points of the skin a camera will see is not known; that it shows the tip is.
    """
    skin = [j for j, o in enumerate(prepared.outputs) if o.group == "skin"]
    if not skin:
        return prepared, noise
    senses, sigma = prepared.robot.build().senses, float(np.max(noise.sigma[skin]))
    tip = [Output(Channel(f"tip_{a}", "output", "mm", sigma), "marker", senses[f"tip_{a}"].index, k) for k, a in enumerate("xyz")]
    keep = [j for j in range(len(prepared.outputs)) if j not in skin]
    outputs = (*(prepared.outputs[j] for j in keep), *tip)
    rho, fade = (np.append(x[keep], np.zeros(3)) for x in (noise.rho, noise.lasting[1]))
    return replace(prepared, outputs=outputs), replace(noise, sigma=np.append(noise.sigma[keep], 3 * [sigma]), rho=rho, fade=fade)


def _separation(objective: Objective, b: Fit, at: Evaluation, d: np.ndarray) -> float:
    """Return the part of |d|^2, d = W (y_A - y_B), that B's parameters cannot imitate within their present covariance."""
    J = objective.jacobian(at, range(len(b.model.free)))
    inner = b.information() + J.T @ J
    u = J.T @ d
    return float(max(0.0, d @ d - u @ solve(inner + 1e-9 * np.eye(len(u)), u)))
