"""Signs and directions: displacements of the opposite sign, readings negated, gravity in another direction or in g."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twin.body import Drive
from twin.diagnosis.checks.suspicions.case import Case, Suspicion, called
from twin.diagnosis.checks.suspicions.units import best
from twin.diagnosis.thresholds import GRAVITY_RANGE, HALVINGS_FOR_ZERO
from twin.prediction.prepared import Inputs


def outputs(case: Case) -> Iterator[Suspicion]:
    """Yield scalar outputs that fit if negated, channel by channel. (Positions and orientations are checked as frames.)"""
    nominal = case.as_is()
    if nominal is None:
        return
    for group in dict.fromkeys(o.group for o in case.prepared.outputs if o.group not in ("marker", "turn")):
        wrong = []
        for j in case.columns(group):
            measured = [np.where(np.arange(y.shape[1]) == j, -y, y) for y in case.prepared.measured]
            turned = replace(case, prepared=replace(case.prepared, measured=tuple(measured)))
            left = turned.better(case.error([j], nominal), turned.error([j], nominal), [j])
            if left is not None:
                wrong.append((left, case.prepared.outputs[j].channel))
        if wrong:
            names = ", ".join(c.name for _, c in wrong)
            words = f"{names}: falls where the robot as described rises, and rises where it falls"
            change = f"the columns {names} with the other sign (positive is pulled in, taut, counter-clockwise)"
            yield Suspicion("sign", words, change, max(left for left, _ in wrong), group)


def displacements(case: Case) -> Iterator[Suspicion]:
    """Yield commanded displacements or angles of the opposite sign: as they are no tendon ever pulls, or the wrong one."""
    of = np.array([d is Drive.DISPLACEMENT for d in case.prepared.drives])
    if not of.any():
        return
    channels = [c for c, by in zip(case.prepared.drivers, of, strict=True) if by]
    most = max(float(i.command[:, of].max()) for i in case.prepared.inputs)
    pulls = "no tendon ever pulls: none is drawn in beyond the straight robot" if most <= 0 else "the wrong tendons pull"
    change = f"the columns {called(channels)} with the other sign (positive is pulled in)"
    tried = [("", lambda i: replace(i, command=np.where(of, -i.command, i.command)))]
    yield from best(case, "sign", f"with {called(channels)} as written {pulls}", change, tried)
    single = dict.fromkeys(c.name for c in channels)
    if len(single) > 1:
        by = {name: np.array([c.name == name for c in case.prepared.drivers]) for name in single}
        turned = [(n, lambda i, w=w: replace(i, command=np.where(w, -i.command, i.command))) for n, w in by.items()]
        words = "one drive turns the other way than the others"
        yield from best(case, "one sign", words, "the column {} with the other sign (positive is pulled in)", turned)


def zeros(case: Case) -> Iterator[Suspicion]:
    """Yield the zero of one drive by displacement, where no equilibrium is found and another zero gives one: the nearest."""
    columns, found = case.columns(case.group), []
    for t in [] if case.predicted is not None else [k for k, d in enumerate(case.prepared.drives) if d is Drive.DISPLACEMENT]:
        low, high = 0.0, max(float(np.abs(i.command[:, t]).max()) for i in case.prepared.inputs)
        shown = case.again(lambda i, t=t, by=high: _paid_out(i, t, by))
        for _ in range(HALVINGS_FOR_ZERO if shown else 0):
            middle = 0.5 * (low + high)
            reached = case.again(lambda i, t=t, by=middle: _paid_out(i, t, by))
            low, high, shown = (low, middle, reached) if reached else (middle, high, shown)
        left = case.better(np.inf, case.error(columns, shown, case.few()), columns)
        if left is not None:
            found.append((left, high, case.prepared.drivers[t], abs(case.prepared.pull[t])))
    if found:
        left, by, channel, pull = min(found, key=lambda f: f[0])
        beyond = f"{float(channel.unit_scale.without_offset().from_si(np.array([by / pull]))[0]):.2g} {channel.unit}"
        words = f"{channel.name} is beyond what the body allows, by {beyond} or more"
        change = f"its zero: offset = -{beyond.split()[0]} or less in its [[channel]]"
        yield Suspicion("zero", words, change, left, case.group)


def _paid_out(i: Inputs, t: int, by: float) -> Inputs:
    return replace(i, command=i.command - by * (np.arange(i.command.shape[1]) == t))


def size(case: Case) -> Iterator[Suspicion]:
    """Yield gravity in g, or in another unit."""
    sizes = np.array([np.linalg.norm(i.loads.gravity) for i in case.prepared.inputs])
    odd = sizes[(sizes > 0) & ((sizes < GRAVITY_RANGE[0]) | (sizes > GRAVITY_RANGE[1]))]
    if odd.size:
        words = f"gravity is {odd[0]:.4g} m/s^2 long, and on earth it is 9.78 to 9.83"
        yield Suspicion("gravity size", words, f"gravity in m/s^2, {9.81 / odd[0]:.4g} times as long (or [0, 0, 0] for none)")


def gravity(case: Case) -> Iterator[Suspicion]:
    """Yield gravity along another axis or with the opposite sign."""
    loads = [i.loads.gravity for i in case.prepared.inputs]
    if any(not np.allclose(g, loads[0]) for g in loads):
        ways = [("the other sign in every gravity", lambda i: replace(i, loads=replace(i.loads, gravity=-i.loads.gravity)))]
    else:
        size, axes = float(np.linalg.norm(loads[0])), [s * np.eye(3)[a] for a in range(3) for s in (1.0, -1.0)]
        ways = [
            (f"gravity = {(np.round(size * a, 3) + 0.0).tolist()}", lambda i, a=a: _under(i, size * a))
            for a in axes
            if size and not np.allclose(size * a, loads[0], atol=0.1 * size)
        ]
    words = f"under gravity = {(np.round(loads[0], 3) + 0.0).tolist()} m/s^2 the robot as described would not move as measured"
    yield from best(case, "gravity direction", words, "{} (base frame, z from base to tip)", ways)


def _under(i: Inputs, g: np.ndarray) -> Inputs:
    return replace(i, loads=replace(i.loads, gravity=g))
