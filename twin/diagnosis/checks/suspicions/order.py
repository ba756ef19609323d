"""Order: tendons or markers exchanged."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from twin.diagnosis.checks.suspicions.case import Case, Suspicion, rms
from twin.diagnosis.checks.suspicions.units import best
from twin.diagnosis.thresholds import LEFT_BY_FILE_CHANGE

BUILT = ("sensor",)  # readings whose level and gain every built robot has its own of


def tendons(case: Case) -> Iterator[Suspicion]:
    """Two driving channels exchanged, or all of them counted from another one; not where the robot as described bends as measured,
    for one that bends another way is off by as much as it bends."""
    n, columns = case.prepared.n_tendon, case.columns(case.group)
    if case.error(columns, case.as_is(), case.few()) < LEFT_BY_FILE_CHANGE * case.motion(columns):
        return
    pairs = [_swap(n, i, j) for i, j in itertools.combinations(range(n), 2)]
    ways = [*pairs, *(np.roll(np.arange(n), s) for s in range(1, n) if n > 2)]
    names = [c.name for c in case.prepared.drivers]
    if len(set(names)) < n:
        return  # one drive for several tendons
    tried = [(_said(names, order), lambda i, o=order: replace(i, command=i.command[:, o])) for order in ways]
    words = "the robot as described would bend another way than measured under these commands"
    yield from best(case, "tendon order", words, "{}", tried)


def _swap(n: int, i: int, j: int) -> np.ndarray:
    order = np.arange(n)
    order[[i, j]] = j, i
    return order


def _said(names: list[str], order: np.ndarray) -> str:
    return ", ".join(f"the column {names[o]} as {names[i]}" for i, o in enumerate(order) if i != o)


def markers(case: Case) -> Iterator[Suspicion]:
    """Points, or scalar channels of a group, that each follow another one's prediction."""
    if case.predicted is None:
        return
    names, columns = case.points()
    groups = {"marker": (names, columns)} if not case.unregistered else {}
    for group in dict.fromkeys(o.group for o in case.prepared.outputs if o.group != "marker"):
        own = case.columns(group)
        groups[group] = [case.prepared.outputs[j].channel.name for j in own], np.array(own)[:, None]
    y, p = (np.concatenate([v[k] for k in case.trials]) for v in (case.prepared.measured, case.predicted))
    dead = case.dead()
    for group, (names, columns) in groups.items():
        alive = np.flatnonzero(~np.isin(columns, dead).any(axis=1))
        names, columns = [names[a] for a in alive], columns[alive]
        left = _followed if group in BUILT else _left
        cost = np.array([[left(y[:, a], p[:, b]) for b in columns] for a in columns])
        if len(columns) < 2 or not np.isfinite(cost).all():
            continue
        _, of = linear_sum_assignment(cost**2)
        moved = np.flatnonzero(of != np.arange(len(of)))
        if not moved.size:
            continue
        before, after = (rms(cost[moved, x]) for x in (moved, of[moved]))
        if after < LEFT_BY_FILE_CHANGE * before:
            change = ", ".join(f"the column{'s' if group == 'marker' else ''} {names[i]} as {names[of[i]]}" for i in moved)
            words = f"{', '.join(names[i] for i in moved)} each stand where another of them should"
            yield Suspicion(
                "marker order" if group == "marker" else "channel order", words, change, after / before, f"{group} order"
            )


def _left(y: np.ndarray, p: np.ndarray) -> float:
    """RMS of what a prediction leaves of readings."""
    return rms(y - p)


def _followed(y: np.ndarray, p: np.ndarray) -> float:
    """RMS of what the best rising straight line in a prediction leaves of readings, both about their means."""
    y, p = y[:, 0], p[:, 0]
    known = np.isfinite(y)
    y, p = y[known] - y[known].mean(), p[known] - p[known].mean()
    slope = max(0.0, float(p @ y) / max(float(p @ p), 1e-300))
    return rms(y - slope * p)
