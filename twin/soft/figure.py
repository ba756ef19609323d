"""Silicone as it is drawn: its skin, strained along the finger, and the tendons in it; fingers on a palm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.body import Heating, Path
from twin.effects import Loads, Route
from twin.figure import Frames, Instant, Range, stacked
from twin.soft.body import SoftBody
from twin.soft.cables import follow, unpulled
from twin.soft.hand import HandBody, HandPath
from twin.soft.room import parts_of, undeformed
from twin.soft.statics import SoftStatics, turned

RINGS, AROUND = 28, 32  # of the drawn skin
PALM, THICK = (89, 94, 102), 5e-3  # colour, and m, of a hand's palm


class SoftFigure:
    """As `Figure`. Its colours are the strain of the skin, the resistance of the cords, or the tension along the tendons."""

    shades: tuple[str, ...] = ("strain", "resistance", "tension")

    def __init__(self, body: SoftBody) -> None:
        self._body, self._parts, self._statics = body, parts_of(body), SoftStatics(body)
        self.cylinders, self.colour = np.zeros((0, 2)), np.zeros((0, 3), np.uint8)
        cone = body.cone
        self.height = cone.length
        z, t = np.linspace(0.0, cone.length, RINGS), 2.0 * np.pi * np.arange(AROUND) / AROUND
        Z, T = (v.ravel() for v in np.meshgrid(z, t, indexing="ij"))
        skin = np.column_stack([cone.radius(Z) * np.cos(T), cone.radius(Z) * np.sin(T), Z])
        self._skin = np.vstack([skin, [[0.0, 0.0, cone.length]]])
        self._weights = body.lattice.weights(self._skin)
        self.holds = np.column_stack([Z / cone.length, T + body.turn, np.zeros(len(Z))])
        ring, k = np.arange(RINGS - 1)[:, None] * AROUND, np.arange(AROUND)
        a, b = ring + k, ring + (k + 1) % AROUND
        sides = [np.stack([a, b, b + AROUND], -1), np.stack([a, b + AROUND, a + AROUND], -1)]
        last = (RINGS - 1) * AROUND
        cap = np.stack([last + k, last + (k + 1) % AROUND, np.full(AROUND, len(skin))], -1)
        self.faces = np.concatenate([*(s.reshape(-1, 3) for s in sides), cap]).astype(np.uint32)

    def grips(self, shown: Frames) -> np.ndarray:
        return shown.skin[0, :-1]

    def coloured(self, shade: str, most: float) -> Range:
        return {
            "strain": Range("strain of the skin along the finger", "%", 100.0, -30.0, 30.0),
            "resistance": Range("resistance of the sensor cords, R/R0 - 1", "%", 100.0, -30.0, 30.0),
            "tension": Range("tension along the tendons", "N", 1.0, 0.0, most),
        }[shade]

    def frames(self, path: Path, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        cables, turn = self._parts.cables, turned(self._body.turn).T
        start = undeformed(self._parts, np.empty((0, 0, 0, 6)))
        slip, beyond, pulled, drawn = start.slip, start.beyond, unpulled(cables), []
        for q, tension in zip(path.q, path.tension, strict=True):
            u = q.reshape(-1, 3)
            follow(cables, u, slip, beyond, float(route.mu), float(route.presliding), pulled)
            slip, beyond = pulled.slip.copy(), pulled.beyond.copy()
            points = (cables.rest + cables.weights @ u) @ turn
            piece = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
            skin = self._skin + self._weights @ u
            along = (tension[:, None] * pulled.share).ravel()
            lines, change = self._cords(u, turn)
            drawn.append(
                Instant(piece=piece, tension=along, skin=skin @ turn, strain=self._strain(skin), cord=lines, resistance=change)
            )
        return stacked(drawn, path.markers)

    def _cords(self, u: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pieces (c, 2, 3) m of the cords at nodes' displacements u (n_free, 3) m, and R/R0 - 1 (c,) of each one's cord."""
        line, felt = self._statics.cords(u[None])[0] @ turn, self._statics.sensed(u[None])
        pieces = np.stack([line[:, :-1], line[:, 1:]], axis=2)
        return pieces.reshape(-1, 2, 3), np.repeat(felt["sensor"][0] / felt["sensor_rest"][0] - 1.0, pieces.shape[1])

    def _strain(self, skin: np.ndarray) -> np.ndarray:
        """(v,) of the lines along the finger, the mean of the pieces that meet at a point."""

        def spans(x: np.ndarray) -> np.ndarray:
            return np.linalg.norm(np.diff(x[:-1].reshape(RINGS, AROUND, 3), axis=0), axis=2)

        e = spans(skin) / spans(self._skin) - 1.0
        at = np.concatenate([e[:1], 0.5 * (e[1:] + e[:-1]), e[-1:]]).ravel()
        return np.append(at, at[-AROUND:].mean())


class HandFigure:
    """As `Figure`: the fingers' own, each in its place, and the palm."""

    shades = SoftFigure.shades

    def __init__(self, body: HandBody) -> None:
        self._body, self._fingers = body, [SoftFigure(finger) for finger in body.fingers]
        radius = float(np.linalg.norm(body.places[:, :2], axis=1).max())
        self.cylinders, self.colour = np.array([[radius, THICK]]), np.array([PALM], np.uint8)
        self.height = self._fingers[0].height
        n = self._fingers[0].faces.max() + 1
        self.faces = np.concatenate([f.faces + k * n for k, f in enumerate(self._fingers)]).astype(np.uint32)
        angle = np.arctan2(body.turns[:, 1, 0], body.turns[:, 0, 0])
        self.holds = np.concatenate([f.holds + np.array([0.0, angle[k], k]) for k, f in enumerate(self._fingers)])

    def grips(self, shown: Frames) -> np.ndarray:
        each = np.split(shown.skin[0], len(self._fingers))
        return np.concatenate([skin[:-1] for skin in each])

    def coloured(self, shade: str, most: float) -> Range:
        return self._fingers[0].coloured(shade, most)

    def frames(self, path: Path, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        assert isinstance(path, HandPath)
        each = enumerate(zip(self._fingers, path.fingers, strict=True))
        own = [finger.frames(answer, self._body.felt(k, loads), route) for k, (finger, answer) in each]
        n = len(path.markers)

        def placed(name: str) -> np.ndarray:
            of = zip(own, self._body.turns, self._body.places, strict=True)
            return np.concatenate([getattr(frames, name) @ turn.T + place for frames, turn, place in of], axis=1)

        palm = np.tile([0.0, 0.0, -THICK], (n, 1, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1, 1))
        values = {name: np.concatenate([getattr(f, name) for f in own], axis=1) for name in self.shades}
        points = {name: placed(name) for name in ("piece", "skin", "cord")}
        return replace(own[0], place=palm[0], turn=palm[1], markers=path.markers, **values, **points)
