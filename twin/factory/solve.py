"""A chain of equilibria: every sample's shape, found from the one before."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from twin.effects import Route
from twin.factory.draw import LENGTH, STEPS, Chain, Pushes
from twin.soft import Cone, SoftBody, SoftStatics, lattice
from twin.soft.solid import Burden, Pull, Shape, Solid

SMALLEST = 1 / 64  # of a step between two samples
RINGS, AROUND, FACE = 36, 32, 8  # points of the skin that carry a push: rings on the mantle, rings on the tip's face
NO_WALL = np.zeros(5)
PLAIN = Route()
CLOSE = 1e-7  # m


@dataclass(frozen=True)
class Surface:
    """Points (m, 3) m of the free skin at rest, the area (m,) m^2 each stands for, and how they move with the free nodes."""

    points: np.ndarray
    area: np.ndarray
    weights: np.ndarray

    def force(self, pushes: Pushes) -> np.ndarray:
        """(n_free, 3) N on the free nodes."""
        out = np.zeros((self.weights.shape[1], 3))
        radius = np.interp(pushes.height, *self._profile())
        centre = np.column_stack([radius * np.cos(pushes.azimuth), radius * np.sin(pushes.azimuth), pushes.height])
        for c, width, force in zip(centre, pushes.width, pushes.force, strict=True):
            patch = self.area * np.exp(-((self.points - c) ** 2).sum(axis=1) / (2.0 * width**2))
            out += np.outer(patch / patch.sum() @ self.weights, force)
        return out

    def _profile(self) -> tuple[np.ndarray, np.ndarray]:
        mantle = self.points[: RINGS * AROUND].reshape(RINGS, AROUND, 3)
        return mantle[:, 0, 2], np.hypot(mantle[:, 0, 0], mantle[:, 0, 1])


@lru_cache(maxsize=4)
def surface(cone: Cone, cells: int) -> Surface:
    z = cone.clamp + (cone.length - cone.clamp) * (np.arange(RINGS) + 0.5) / RINGS
    t = 2.0 * np.pi * np.arange(AROUND) / AROUND
    Z, T = (v.ravel() for v in np.meshgrid(z, t, indexing="ij"))
    share = (np.arange(FACE) + 0.5) / FACE
    Q, S = (v.ravel() for v in np.meshgrid(share * cone.tip, t, indexing="ij"))
    radius = np.concatenate([cone.radius(Z), Q])
    angle, height = np.concatenate([T, S]), np.concatenate([Z, np.full(len(Q), cone.length)])
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    depth = np.concatenate([np.full(len(Z), (cone.length - cone.clamp) / RINGS), np.full(len(Q), cone.tip / FACE)])
    return Surface(points, radius * 2.0 * np.pi / AROUND * depth, lattice(cone, cells).weights(points))


@dataclass(frozen=True)
class Solved:
    """One chain: nodes' displacements (n, n_free, 3) m, strain (n, s), resistance (n, s) ohm, tension (n, t) N, command (n, t) m,
    and whether each sample was found (n,)."""

    nodes: np.ndarray
    strain: np.ndarray
    resistance: np.ndarray
    tension: np.ndarray
    command: np.ndarray
    found: np.ndarray


def weight_of(body: SoftBody, gravity: np.ndarray) -> np.ndarray:
    """(n_free, 3) N: the finger's own weight."""
    return np.outer(body.lattice.volume, body.density * gravity)


def walk(statics: SoftStatics, chain: Chain, weight: np.ndarray) -> Solved:
    """The chain's samples in order. A sample without an equilibrium repeats the shape before it, `found` false."""
    body, solid = statics.body, Solid(statics.parts)
    skin = surface(body.cone, body.cells)
    shape = solid.rest()
    hanging = hang(solid, shape, weight)
    nt = len(hanging)
    nodes, tension = np.empty((LENGTH, *shape.u.shape)), np.empty((LENGTH, nt))
    command, found = np.empty((LENGTH, nt)), np.zeros(LENGTH, bool)
    at, force, goals = np.zeros(nt), np.zeros_like(weight), [skin.force(p) for p in chain.pushes]
    for i in range(LENGTH):
        target, share = i // STEPS, 1.0 / (STEPS - i % STEPS)
        goal, push = at + share * (chain.command[target] - at), force + share * (goals[target] - force)
        shape, found[i] = march(solid, shape, hanging, (at, weight + force), (goal, weight + push))
        at, force = goal, push
        nodes[i], tension[i], command[i] = shape.u, shape.tension, goal
    sensed = statics.sensed(nodes)
    return Solved(nodes, sensed["strain"], sensed["sensor"], tension, command, found)


def hang(solid: Solid, shape: Shape, weight: np.ndarray) -> np.ndarray:
    """Bring `shape` to its hanging rest; lengths (t,) m of the tendons there."""
    nt = len(shape.tension)
    slack = Pull(np.zeros(nt), np.zeros(nt, bool), np.zeros(nt), np.zeros(nt), 0.0, 1.0)
    solid.settle(shape, slack, Burden(weight, NO_WALL))
    return solid.pulled.length.copy()


State = tuple[np.ndarray, np.ndarray]  # tendon displacements (t,) m, forces on the free nodes (n_free, 3) N


def march(
    solid: Solid, shape: Shape, hanging: np.ndarray, start: State, goal: State, route: Route = PLAIN, close: float = CLOSE
) -> tuple[Shape, bool]:  # fmt: skip
    """From one state to another in ever smaller parts where Newton's method is lost; the last shape found, and whether it is the
    goal's: to a last step of `close` (m)."""
    nt, done, part = len(hanging), 0.0, 1.0
    held, zero, stretch = np.ones(nt, bool), np.zeros(nt), np.full(nt, route.stretch)
    while done < 1.0:
        trial, to = shape.copy(), min(1.0, done + part)
        at, force = (a + to * (b - a) for a, b in zip(start, goal, strict=True))
        pull = Pull(zero, held, hanging - at, stretch, route.mu, route.presliding)
        if solid.settle(trial, pull, Burden(force, NO_WALL), close=close):
            shape, done, part = trial, to, 2.0 * part
            continue
        part, shape.inverse = 0.5 * part, None
        if part < SMALLEST:
            return shape, False
    return shape, True
