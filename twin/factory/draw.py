"""What one chain of samples is asked: tendon commands and pushes on the skin, drawn from declared priors.

A chain walks from rest through `TARGETS` targets in `STEPS` samples each, commands and forces in equal parts, so that every shape
is close to the one before and half-made pushes are among the samples. Priors (ours; ranges of a finger that hands and motors bend
by up to some 60 degrees):

    kind       free motion | pushed with every tendon paid out | pushed while the tendons hold or pull
    tendons    d_i = c + bend cos(azimuth - azimuth_i): bend up to 11.5 mm, co-contraction c up to 2.5 mm a pair
    pushes     up to 3 at once, patches exp(-|X - X_c|^2 / 2 w^2) of width 6 .. 25 mm anywhere above 25 mm, inwards within some 20
               degrees, as strong as bends the finger by moments of up to 70 N mm about the clamp, at most 1.2 N
    numbers    the robot's uncertain ones (E, phi, R0, kappa) normal with their std, inside their bounds
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.quantities import Parameter
from twin.soft import Cone

KINDS = ("free", "pushed", "both")
SHARES = (0.3, 0.4, 0.3)
TARGETS, STEPS = 4, 4
LENGTH = TARGETS * STEPS
PUSHES = 3
PAID_OUT = -15e-3  # m
BEND, PRETENSION = 11.5e-3, 2.5e-3  # m
WIDTH = (6e-3, 25e-3)  # m
LOWEST = 25e-3  # m
MOMENT, STRONGEST = 70e-3, 1.2  # N m, N
ASKEW = 0.35  # of each component of the direction, against straight inwards


@dataclass(frozen=True)
class Pushes:
    """Patches at `height` (k,) m and `azimuth` (k,) rad of `width` (k,) m with total `force` (k, 3) N."""

    height: np.ndarray
    azimuth: np.ndarray
    width: np.ndarray
    force: np.ndarray


@dataclass(frozen=True)
class Chain:
    """`command` (TARGETS, t) m and pushes at every target; `values` of the finger that differ from those described."""

    kind: int
    command: np.ndarray
    pushes: tuple[Pushes, ...]
    values: dict[str, float]


def generator(seed: int, chain: int) -> np.random.Generator:
    """Each chain's own stream: what is drawn depends on the seed and the chain alone."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(chain,)))


def draw(rng: np.random.Generator, cone: Cone, azimuth: np.ndarray, doubts: Sequence[Parameter]) -> Chain:
    """A chain for a finger with tendons at `azimuth` (t,) rad and uncertain numbers `doubts`."""
    kind = int(rng.choice(len(KINDS), p=SHARES))
    values = {p.name: float(np.clip(rng.normal(p.value, p.std or 0.0), p.low, p.high)) for p in doubts}
    command = np.full((TARGETS, len(azimuth)), PAID_OUT)
    if KINDS[kind] != "pushed":
        command = np.stack([_tendons(rng, azimuth) for _ in range(TARGETS)])
    count = 0 if KINDS[kind] == "free" else PUSHES
    return Chain(kind, command, tuple(draw_pushes(rng, cone, count) for _ in range(TARGETS)), values)


def _tendons(rng: np.random.Generator, azimuth: np.ndarray) -> np.ndarray:
    bend, towards = BEND * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    pretension = rng.uniform(-0.3, 1.0, 2) * PRETENSION * rng.uniform()
    return bend * np.cos(azimuth - towards) + pretension[np.arange(len(azimuth)) % 2]


def draw_pushes(rng: np.random.Generator, cone: Cone, count: int) -> Pushes:
    """Up to `count` pushes at once."""
    height = rng.uniform(LOWEST, cone.length, count)
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)
    strength = np.minimum(MOMENT / (height - cone.clamp), STRONGEST) * rng.uniform(0.0, 1.0, count)
    strength *= rng.uniform(size=count) < (0.9, 0.5, 0.25)[:count]  # mostly one or two at once
    inwards = np.column_stack([-np.cos(azimuth), -np.sin(azimuth), np.zeros(count)])
    aim = inwards + ASKEW * rng.normal(size=(count, 3))
    aim /= np.linalg.norm(aim, axis=1, keepdims=True)
    return Pushes(height, azimuth, rng.uniform(*WIDTH, count), strength[:, None] * aim)
