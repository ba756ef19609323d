"""The next experiment: the one trial, from a menu the robot can run, that best separates the two best explanations.

T-optimality (Atkinson and Fedorov 1975): with both models fitted to today's data, T = min over B's parameters, held by their
present covariance, of |W (y_A - y_B)|^2; T = 25 separates them by five standard errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twin.bench import Bench, Inputs
from twin.calibrate import Fit, Objective
from twin.errors import SolveError
from twin.residual import Noise, Whitener

ENOUGH = 25.0
RATE = 2.0  # samples a second


@dataclass(frozen=True)
class Experiment:
    """A trial in words, the separation T of one run of it, how many runs reach T = 25, and the sets of effects it separates."""

    words: str
    separation: float
    repeats: int
    between: tuple[tuple[str, ...], tuple[str, ...]]


def menu(bench: Bench) -> list[tuple[str, Inputs]]:
    """Trials this robot could run, within the tensions already used; payload up to three times as much, at most 30 g."""
    n = bench.n_tendon
    top = max(float(i.tension.max()) for i in bench.inputs)
    heaviest = max(i.loads.payload for i in bench.inputs)
    payloads = sorted({0.0, min(0.03, max(0.01, 3.0 * heaviest))})
    shapes: list[tuple[str, np.ndarray, np.ndarray]] = []

    def add(words: str, duration: float, *columns: np.ndarray) -> None:
        shapes.append((words, np.linspace(0.0, duration, len(columns[0])), np.stack(columns, axis=1)))

    up_down = np.concatenate([np.linspace(0, 1, 30), np.linspace(1, 0, 30)])
    for i in range(n):
        pull = [top * up_down if j == i else 0.0 * up_down for j in range(n)]
        add(f"pull tendon {i + 1} to {top:.1f} N and release it, slowly (120 s)", 120.0, *pull)
        add(f"pull tendon {i + 1} to {top:.1f} N and release it, fast (4 s)", 4.0, *pull)
        hold = np.concatenate([[0.0], np.full(60, 0.75 * top)])
        add(
            f"step tendon {i + 1} to {0.75 * top:.1f} N and hold for 120 s",
            120.0,
            *(hold if j == i else 0.0 * hold for j in range(n)),
        )
    turns = np.linspace(0, 4 * np.pi, 80)
    circle = [0.6 * top * np.maximum(0.0, 0.5 + 0.5 * np.cos(turns - 2 * np.pi * j / n)) for j in range(n)]
    add(f"two circles with all tendons up to {0.6 * top:.1f} N (160 s)", 160.0, *circle)
    add("rest unloaded for 60 s", 60.0, *(np.zeros(30) for _ in range(n)))
    last = max(float(i.clock[-1]) for i in bench.inputs)
    like = bench.inputs[0]
    out = []
    for payload in payloads:
        for words, time, tension in shapes:
            loads = replace(like.loads, payload=payload, force=np.zeros(3))
            label = f"{words}, tip payload {1e3 * payload:.0f} g"
            out.append((label, Inputs(label, time, last + 60.0 + time, tension, np.full(len(time), like.temperature[0]), loads)))
    return out


def next_experiment(bench: Bench, noise: Noise, a: Fit, b: Fit, jobs: int) -> Experiment | None:
    """The trial of the menu with the largest separation of the rival `b` from the claimed `a`; None where no trial helps."""
    best: Experiment | None = None
    rivals = tuple(e.id for e in a.model.twin.effects), tuple(e.id for e in b.model.twin.effects)
    for words, inputs in menu(bench):
        n = len(inputs.time)
        empty = np.zeros((n, len(bench.outputs)))
        imagined = replace(bench, inputs=(inputs,), measured=(empty,))
        whitener = Whitener(
            replace(noise, tension=0.0), [empty], [np.zeros((n, len(bench.outputs), bench.n_tendon))], [inputs.tension]
        )
        objective = Objective(imagined, [0], whitener, jobs)
        try:
            T = _separation(objective, a, b)
        except SolveError:
            continue
        if best is None or best.separation < T:
            best = Experiment(words, T, max(1, int(np.ceil(ENOUGH / max(T, 1e-9)))), rivals)
    return best if best is not None and best.repeats <= 50 else None


def _separation(objective: Objective, a: Fit, b: Fit) -> float:
    """|W (y_A - y_B)|^2 left when B's parameters move within their present covariance to imitate A."""
    at = objective.evaluate(b.model)
    d = objective.evaluate(a.model).z - at.z
    J = objective.jacobian(at, range(len(b.model.free)))
    inner = b.information() + J.T @ J
    u = J.T @ d
    return float(max(0.0, d @ d - u @ np.linalg.solve(inner + 1e-9 * np.eye(len(u)), u)))
