"""Draw random chains of samples: tendon commands and pushes on the skin, from declared priors.

A chain goes from rest through `CHAIN_TARGETS` targets in `STEPS_PER_TARGET` samples each, commands and forces in equal parts, so
that every shape is close to the one before and partial pushes are among the samples. Priors (ours; ranges of a finger that hands
and motors bend by up to some 60 degrees):

    kind       free motion | pushed with every tendon paid out | pushed while the tendons hold or pull
    tendons    d_i = c + bend cos(azimuth - azimuth_i): bend up to 11.5 mm, co-contraction c up to 2.5 mm a pair
    pushes     up to 3 at once, patches exp(-|X - X_c|^2 / 2 w^2) of width 6 .. 25 mm anywhere above 25 mm, inwards within some 20
               degrees, as strong as bends the finger by moments of up to 70 N mm about the clamp, at most 1.2 N
    numbers    the robot's uncertain ones (E, phi, R0, kappa) normal with their std, inside their bounds
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.foundation.parameters import Parameter
from twin.mechanics.silicone import Cone
from twin.mechanics.silicone.skin_loads import Pushes

CHAIN_KINDS = ("free", "pushed", "both")
KIND_SHARES = (0.3, 0.4, 0.3)  # probability of each kind
CHAIN_TARGETS, STEPS_PER_TARGET = 4, 4
CHAIN_LENGTH = CHAIN_TARGETS * STEPS_PER_TARGET  # samples in a chain
MOST_PUSHES = 3  # at once
PAID_OUT_DISPLACEMENT = -15e-3  # m, of a tendon that holds nothing
LARGEST_BEND, LARGEST_PRETENSION = 11.5e-3, 2.5e-3  # m, of the tendons' bend and of a pair's co-contraction
PUSH_WIDTHS = (6e-3, 25e-3)  # m, range of a patch's width
LOWEST_PUSH = 25e-3  # m above the base
LARGEST_PUSH_MOMENT, LARGEST_PUSH_FORCE = 70e-3, 1.2  # N m about the clamp, and N
PUSH_DIRECTION_SPREAD = 0.35  # standard deviation of each component of the direction, against straight inwards


@dataclass(frozen=True)
class Chain:
    """One random chain: its kind, `command` (CHAIN_TARGETS, t) m and pushes at every target, and `values` of the finger that differ
    from the description."""

    kind: int
    command: np.ndarray
    pushes: tuple[Pushes, ...]
    values: dict[str, float]


def chain_rng(seed: int, chain: int) -> np.random.Generator:
    """Return the chain's own random generator, which depends on the seed and the chain alone."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(chain,)))


def draw_chain(rng: np.random.Generator, cone: Cone, azimuth: np.ndarray, uncertain: Sequence[Parameter]) -> Chain:
    """Draw a chain for a finger with tendons at `azimuth` (t,) rad and uncertain numbers `doubts`."""
    kind = int(rng.choice(len(CHAIN_KINDS), p=KIND_SHARES))
    values = {p.name: float(np.clip(rng.normal(p.value, p.std or 0.0), p.low, p.high)) for p in uncertain}
    command = np.full((CHAIN_TARGETS, len(azimuth)), PAID_OUT_DISPLACEMENT)
    if CHAIN_KINDS[kind] != "pushed":
        command = np.stack([_draw_tendons(rng, azimuth) for _ in range(CHAIN_TARGETS)])
    count = 0 if CHAIN_KINDS[kind] == "free" else MOST_PUSHES
    return Chain(kind, command, tuple(draw_pushes(rng, cone, count) for _ in range(CHAIN_TARGETS)), values)


def _draw_tendons(rng: np.random.Generator, azimuth: np.ndarray) -> np.ndarray:
    """Draw displacements (t,) m of all tendons."""
    bend, towards = LARGEST_BEND * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    pretension = rng.uniform(-0.3, 1.0, 2) * LARGEST_PRETENSION * rng.uniform()
    return bend * np.cos(azimuth - towards) + pretension[np.arange(len(azimuth)) % 2]


def draw_pushes(rng: np.random.Generator, cone: Cone, count: int) -> Pushes:
    """Draw up to `count` pushes at once."""
    height = rng.uniform(LOWEST_PUSH, cone.length, count)
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)
    strength = np.minimum(LARGEST_PUSH_MOMENT / (height - cone.clamp), LARGEST_PUSH_FORCE) * rng.uniform(0.0, 1.0, count)
    strength *= rng.uniform(size=count) < (0.9, 0.5, 0.25)[:count]  # mostly one or two
    inwards = np.column_stack([-np.cos(azimuth), -np.sin(azimuth), np.zeros(count)])
    direction = inwards + PUSH_DIRECTION_SPREAD * rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Pushes(height, azimuth, rng.uniform(*PUSH_WIDTHS, count), strength[:, None] * direction)
