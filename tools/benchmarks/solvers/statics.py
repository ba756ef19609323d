"""Speed of the static solve, how often it converges, and its agreement with MuJoCo's steps.

python -m tools.benchmarks.solvers.statics [--solves 10000]
"""

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import tyro

from twin.body import BY_CONTINUATION, DIRECT, NOT_FOUND, Loads, Problem, Route
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.dynamics import Dynamics
from twin.robots import load

FRICTION_ROUTE = Route(0.2, 5e-4)
LOAD_CASES = {
    "hanging": Loads(np.array([0, 0, 9.81])),
    "sideways, 30 g": Loads(np.array([9.81, 0, 0]), 0.03),
    "upright, 10 g": Loads(np.array([0, 0, -9.81]), 0.01),
}


def wandering_tensions(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) s and slowly wandering tensions (n, 3) N within 0-4 N."""
    t = 0.5 * np.arange(n)
    phase, rate = rng.uniform(0, 2 * np.pi, (3, 4)), rng.uniform(0.005, 0.05, (3, 4))
    waves = sum(np.sin(2 * np.pi * rate[:, k] * t[:, None] + phase[:, k]) for k in range(4))
    return t, np.clip(2 + waves, 0, 4)


def seconds(solve: Callable[[Problem], object], *problem: object) -> float:
    """Return the seconds that a problem of times, tensions, loads and route takes to solve."""
    began = time.perf_counter()
    solve(Problem(*problem))  # type: ignore[arg-type]
    return time.perf_counter() - began


RUN = 25  # samples of one timing of warm solves, so that a call's own cost does not count


def speed(solver: Equilibrium, rng: np.random.Generator) -> None:
    """Print median and 95th percentile: warm a sample, over runs of 25 less their start; cold one solve from straight."""
    heads = f"{'warm us':>9} {'p95':>6} {'cold us':>8} {'p95':>6} {'1,500 samples ms':>17}"
    print(f"{'case':>16} {'friction':>8} {heads}")
    t, T = wandering_tensions(rng, 1500)
    for name, loads in LOAD_CASES.items():
        for route in (Route(), FRICTION_ROUTE):
            whole = [seconds(solver.solve, t, T, loads, route) for _ in range(7)]
            starts = range(0, 1500 - RUN, RUN)
            cold = [seconds(solver.solve, t[:1], T[k : k + 1], loads, route) for k in starts]
            runs = [seconds(solver.solve, t[: RUN + 1], T[k : k + RUN + 1], loads, route) for k in starts]
            warm = (np.array(runs) - cold) / RUN
            times = f"{1e6 * np.median(warm):9.1f} {1e6 * np.quantile(warm, 0.95):6.1f}"
            times += f" {1e6 * np.median(cold):8.0f} {1e6 * np.quantile(cold, 0.95):6.0f} {1e3 * np.median(whole):17.1f}"
            print(f"{name:>16} {'yes' if route.mu else 'no':>8} {times}")


def convergence(solver: Equilibrium, rng: np.random.Generator, solves: int) -> None:
    """Solve at random gravity, payload, friction and pre-sliding; smooth paths, jumps and cold starts in equal parts."""
    count = {DIRECT: 0, BY_CONTINUATION: 0, NOT_FOUND: 0}
    unstable = done = 0
    while done < solves:
        way = rng.normal(size=3)
        loads = Loads(9.81 * way / np.linalg.norm(way), rng.uniform(0, 0.03))
        route = Route(float(rng.choice([0.0, 0.1, 0.2, 0.4])), rng.uniform(1e-4, 1e-3))
        kind = rng.integers(3)
        n = 1 if kind == 2 else 50
        t, T = wandering_tensions(rng, n) if kind == 0 else (np.arange(n) * 0.5, rng.uniform(0, 4, (n, 3)))
        path = solver.solve(Problem(t, T, loads, route))
        if path.unstable_start:
            unstable += n
            continue
        done += n
        for status in count:
            count[status] += int((path.status == status).sum())
    print(
        f"{done} solves: {count[DIRECT]} direct, {count[BY_CONTINUATION]} by following the motion, {count[NOT_FOUND]} not found;",
        end=" ",
    )
    print(f"beside them {unstable} samples of trials flagged 'unstable start' (load past buckling)")


def eased(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, tensions (n, 3) N from pose to pose, 24 s eased from rest to rest and 6 s held, and each hold's last sample.

    Eased, because the shape lags the tensions in proportion to their rate, and friction remembers the lag of a ramp that stops
    short: 0.1 mm after straight lines of 24 s, half of it after 48 s.
    """
    poses = rng.uniform(0, 3.5, (5, 3)) * (rng.uniform(size=(5, 3)) < 0.7)
    elapsed = 0.25 * np.arange(1, 121)
    way = np.minimum(elapsed / 24.0, 1.0)
    way = way**2 * (3.0 - 2.0 * way)
    T = np.vstack([poses[:1], *(a + way[:, None] * (b - a) for a, b in pairwise(poses))])
    return 0.25 * np.arange(len(T)), T, way.size * np.arange(1, 5)


def agreement(solver: Equilibrium, rng: np.random.Generator) -> None:
    """Compare with MuJoCo steps that follow tensions slowly from pose to pose and rest there."""
    moving = Dynamics(load("continuum").build({"damping.time": 0.03}))
    print(f"{'case':>16} {'friction':>8} {'median mm':>10} {'p95':>8} {'max':>8}")
    for name, loads in LOAD_CASES.items():
        for route in (Route(), FRICTION_ROUTE):
            errors = []
            for _ in range(4):
                t, T, rest = eased(rng)
                a = moving.solve(Problem(t, T, loads, route))
                b = solver.solve(Problem(t, T, loads, route))
                errors += list(1e3 * np.linalg.norm(a.markers[rest, 7] - b.markers[rest, 7], axis=1))
            e = np.array(errors)
            friction = "yes" if route.mu else "no"
            print(f"{name:>16} {friction:>8} {np.median(e):10.4f} {np.quantile(e, 0.95):8.4f} {e.max():8.4f}")


def main(solves: int = 10_000) -> None:
    """Time the solver, count how often it converges in so many solves, and compare it with MuJoCo's steps."""
    rng = np.random.default_rng(0)
    solver = Equilibrium(load("continuum").build())
    solver.solve(Problem(np.zeros(1), np.zeros((1, 3)), LOAD_CASES["hanging"]))
    speed(solver, rng)
    convergence(solver, rng, solves)
    agreement(solver, rng)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
