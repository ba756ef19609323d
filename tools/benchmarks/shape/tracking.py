"""A soft finger led through wanted shapes, on plants that no controller knows. Prints a Markdown table.

    python -m tools.benchmarks.shape.tracking --seeds 41,42,43 [--days DIR] [--hand]

The plant is a finger of the independent finite element bench (no code in common with the twin): its E, R0, kappa, mounting angle
and tendon friction drawn by the seed, its resistances noisy, one equilibrium after another. The wanted shapes are what another
finger of that bench, drawn by seed + 1000 and clamped as the plant is (no tendon twists a finger), did under a slow wander of its
tendons: its 609 named points in the base frame, and its readings. Before, the twin is aligned to a shape day of the plant (as by
`twin align`; written to --days DIR, some minutes, where it is not there yet). --hand pushes the plant while it follows, and then
`modal` is told that something may press. Seed 31 was used to develop this; 41, 42 and 43 were scored once. In the table:

    shape             the controller, sensing by `modal`            shape, told       sensing replaced by the simulator's truth
    strain            strains: the other finger's true ones are wanted, felt by the aligned cords
    readings          strains: the other finger's readings are wanted, both tared at rest, kappa not known: raw strain
    constant          the source's constant directions              tip               the tip only
    replay            the other finger's shortenings, no sensing
    ..., described    the same by the twin as described, not aligned; its R0 are those read at rest

Rows are ROW_RATE a second; the controllers see the wanted shape of the next row. Mean distance of the points over all rows but
those of the first second, mm.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro

from tools.benchmarks.control.baselines import ConstantDirections, TipTracking
from tools.simulators.finger.bench import LARGEST_PULL_STEP, SLACK, make_finger
from tools.simulators.finger.day import TABLES, make_set
from tools.simulators.finger.effects import all_effects
from tools.simulators.finger.mechanics.cables import interpolation
from tools.simulators.finger.mechanics.hand import Hand
from tools.simulators.finger.mechanics.statics import Load
from tools.simulators.finger.motions import wander
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.write import SENSOR
from twin.control import ShapeController, StrainTracking
from twin.measurements import read
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.alignment.align import align

EFFECT = "tendon_friction"
SHOWING_SEED_OFFSET = 1000  # added to the plant's seed: the finger that shows the shapes
ROW_RATE, DURATION, LARGEST_WANDER = 5.0, 9.0, 8.0  # 1/s, s, mm
SETTLED_AFTER = 1.0  # s


class Plant:
    """A built finger of the bench with friction, drawn as its days are. SI outside."""

    def __init__(self, seed: int, hand: bool = False, clamped: float | None = None) -> None:
        """`clamped`: another mounting angle (deg) than the seed's."""
        making, laws = (np.random.default_rng([seed, n]) for n in (0, 4))
        built = Built.draw(making)
        self.built = built if clamped is None else replace(built, phi_deg=clamped)
        self.finger = make_finger(self.built, [all_effects()[EFFECT].draw(laws, self.built)])
        self.state = self.finger.hanging()
        self.lengths, self.at, self.time = self.state.length.sum(axis=1), np.zeros(4), 0.0
        table = np.genfromtxt(TABLES / "points.csv", delimiter=",", skip_header=1, usecols=(1, 2, 3))
        self.points, self.weights = table, interpolation(self.finger.body, table)
        self.noise = np.random.default_rng([seed, 10])
        self.hand = Hand.draw(np.random.default_rng([seed, 11]), self.finger.skin, DURATION) if hand else None

    def move(self, shortening: np.ndarray, dt: float) -> None:
        """To tendons shortened by (4,) m, in strides, `dt` s later."""
        start, goal = self.at, 1e3 * shortening
        count = max(1, int(np.ceil(np.abs(np.maximum(goal, SLACK) - np.maximum(start, SLACK)).max() / LARGEST_PULL_STEP)))
        for part in np.arange(1, count + 1) / count:
            now = self.time + part * dt
            force = None if self.hand is None else self.hand.at(now, self.finger.skin, len(self.state.u))
            self.state = self.finger.step(self.state, Load(self.lengths - start - part * (goal - start), force=force), dt / count)
        self.at, self.time = goal, self.time + dt

    def vertices(self) -> np.ndarray:
        """(609, 3) m in the base frame."""
        return 1e-3 * (self.points + self.weights @ self.state.u) @ self.built.turn().T

    def strain(self) -> np.ndarray:
        return self.finger.cords.strain(self.state.u)

    def resistance(self) -> np.ndarray:
        """(4,) ohm as read."""
        return self.built.resistance(self.strain()[None])[0] + SENSOR * self.noise.normal(size=4)


@dataclass(frozen=True)
class Shown:
    """What another finger did: shortenings (n, 4) m, points (n, 609, 3) m, strains and tared readings sqrt(R/R_rest) - 1 (n, 4)."""

    shortening: np.ndarray
    vertices: np.ndarray
    strain: np.ndarray
    reading: np.ndarray


def show(seed: int) -> Shown:
    plant = Plant(seed + SHOWING_SEED_OFFSET, clamped=Plant(seed).built.phi_deg)
    command = 1e-3 * wander(np.random.default_rng([seed, 9]), "shown", DURATION, ROW_RATE, 0.2, LARGEST_WANDER).command
    rest, rows = plant.resistance(), []
    for row in command:
        plant.move(row, 1.0 / ROW_RATE)
        rows.append((plant.vertices(), plant.strain(), np.sqrt(plant.resistance() / rest) - 1.0))
    return Shown(command, *(np.array(column) for column in zip(*rows, strict=True)))


@dataclass(frozen=True)
class Followed:
    """Mean vertex error (mm) of each row, and ms of each of the controller's steps."""

    error: np.ndarray
    step: np.ndarray


Ask = Callable[[int, Plant], np.ndarray]


def follow(seed: int, shown: Shown, ask: Ask, hand: bool) -> Followed:
    """The plant of a seed asked, row by row, for shortenings (4,) m."""
    plant, error, spent = Plant(seed, hand), [], []
    for k, vertices in enumerate(shown.vertices):
        before = time.perf_counter()
        shortening = ask(k, plant)
        spent.append(time.perf_counter() - before)
        plant.move(shortening, 1.0 / ROW_RATE)
        error.append(np.linalg.norm(plant.vertices() - vertices, axis=1).mean())
    settled = int(SETTLED_AFTER * ROW_RATE)
    return Followed(1e3 * np.array(error[settled:]), 1e3 * np.array(spent[settled:]))


def asking(law: ShapeController, wanted: np.ndarray, told: bool = False) -> Ask:
    """A controller as what is asked."""

    def ask(k: int, plant: Plant) -> np.ndarray:
        truth = plant.vertices() if told else None
        return law.step(wanted[k], plant.resistance(), 1.0 / ROW_RATE, truth=truth).shortening

    return ask


def ways(shown: Shown, aligned: Twin, described: Twin, hand: bool) -> dict[str, Ask]:
    points = shown.vertices
    return {
        "shape": asking(ShapeController(aligned, pushed=hand), points),
        "shape, told": asking(ShapeController(aligned), points, told=True),
        "strain": asking(StrainTracking(aligned), shown.strain),
        "readings": asking(StrainTracking(described), shown.reading),
        "constant": asking(ConstantDirections(aligned, pushed=hand), points),
        "tip": asking(TipTracking(aligned, pushed=hand), points),
        "replay": lambda k, plant: shown.shortening[k],
        "shape, described": asking(ShapeController(described, pushed=hand), points),
    }


def twins(seed: int, days: Path) -> tuple[Twin, Twin]:
    """The twin aligned to the plant's shape day, and as described but for resistances at rest."""
    if not (days / f"day{seed}").exists():
        make_set(days / f"day{seed}", [EFFECT], seed, shape=True)
    nominal, at_rest = Twin.of(load("finger")), Plant(seed).resistance()
    tared = {f"sensors.resistance_{i}": float(r) for i, r in enumerate(at_rest, 1)}
    return align(read(days / f"day{seed}" / "measured"), nominal).twin, replace(nominal, values={**nominal.values, **tared})


def main(seeds: str, days: Path = Path("days"), hand: bool = False, only: str = "") -> None:
    """Print the table of all ways to follow shapes.

    Args:
        seeds: one plant each, with commas
        days: folder of the plants' shape days
        only: ways, with semicolons
    """
    errors: dict[str, list[np.ndarray]] = {}
    steps: dict[str, list[np.ndarray]] = {}
    for seed in map(int, seeds.split(",")):
        shown, (aligned, described) = show(seed), twins(seed, days)
        for name, ask in ways(shown, aligned, described, hand).items():
            if only and name not in only.split(";"):
                continue
            found = follow(seed, shown, ask, hand)
            errors.setdefault(name, []).append(found.error)
            steps.setdefault(name, []).append(found.step)
            print(f"seed {seed}  {name:20s} {found.error.mean():6.2f} mm, largest {found.error.max():.2f}", flush=True)
    print("\n| | by seed, mm | mean, mm | worst row, mm | a step, ms (median, 95 %, most) |\n|---|---|---|---|---|")
    for name, rows in errors.items():
        ms, every = np.concatenate(steps[name]), np.concatenate(rows)
        took = f"{np.median(ms):.1f}, {np.quantile(ms, 0.95):.1f}, {ms.max():.1f}"
        print(f"| {name} | {', '.join(f'{r.mean():.2f}' for r in rows)} | {every.mean():.2f} | {every.max():.2f} | {took} |")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
