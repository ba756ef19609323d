"""Silicone as it is drawn: skin, strained along the finger, and the tendons in it; fingers on a palm."""

from dataclasses import replace

import numpy as np

from twin.body import Heating, Loads, Route, Solution
from twin.body.drawable import ColourScale, Frames, FrameShapes, Solid, stack_frames
from twin.mechanics.silicone.body import SoftBody
from twin.mechanics.silicone.cables import trace_tendons, unloaded_tendons
from twin.mechanics.silicone.hand import HandBody, HandSolution
from twin.mechanics.silicone.solver_arrays import body_arrays, undeformed_state
from twin.mechanics.silicone.statics import SoftStatics, rotation_about_z

DRAWN_RINGS, DRAWN_AROUND = 28, 32  # points of the drawn skin
PALM_COLOUR, PALM_THICKNESS = (89, 94, 102), 5e-3  # RGB; m


class SoftFigure:
    """`Drawable` of a finger. Colours show strain of the skin, resistance of the cords, or tension along the tendons."""

    colour_fields: tuple[str, ...] = ("strain", "resistance", "tension")
    solids: tuple[Solid, ...] = ()
    view = np.zeros(3)

    def __init__(self, body: SoftBody) -> None:
        self._body, self._parts, self._statics = body, body_arrays(body), SoftStatics(body)
        self.cylinders, self.link_colours = np.zeros((0, 2)), np.zeros((0, 3), np.uint8)
        cone = body.cone
        self.height, self.middle, self.tip = cone.length, np.array([0.0, 0.0, 0.5 * cone.length]), -1
        z, t = np.linspace(0.0, cone.length, DRAWN_RINGS), 2.0 * np.pi * np.arange(DRAWN_AROUND) / DRAWN_AROUND
        Z, T = (v.ravel() for v in np.meshgrid(z, t, indexing="ij"))
        skin = np.column_stack([cone.radius(Z) * np.cos(T), cone.radius(Z) * np.sin(T), Z])
        self._skin = np.vstack([skin, [[0.0, 0.0, cone.length]]])
        self._weights = body.lattice.weights(self._skin)
        self.push_points = np.column_stack([Z / cone.length, T + body.turn, np.zeros(len(Z))])
        ring, k = np.arange(DRAWN_RINGS - 1)[:, None] * DRAWN_AROUND, np.arange(DRAWN_AROUND)
        a, b = ring + k, ring + (k + 1) % DRAWN_AROUND
        sides = [np.stack([a, b, b + DRAWN_AROUND], -1), np.stack([a, b + DRAWN_AROUND, a + DRAWN_AROUND], -1)]
        last = (DRAWN_RINGS - 1) * DRAWN_AROUND
        cap = np.stack([last + k, last + (k + 1) % DRAWN_AROUND, np.full(DRAWN_AROUND, len(skin))], -1)
        self.faces = np.concatenate([*(s.reshape(-1, 3) for s in sides), cap]).astype(np.uint32)

    def push_positions(self, shown: Frames) -> np.ndarray:
        """Return positions as `Drawable.push_positions`."""
        return shown.skin[0, :-1]

    def colour_scale(self, shade: str, most: float) -> ColourScale:
        """Return the scale as `Drawable.colour_scale`."""
        return {
            "strain": ColourScale("strain of the skin along the finger", "%", 100.0, -30.0, 30.0),
            "resistance": ColourScale("resistance of the sensor cords, R/R0 - 1", "%", 100.0, -30.0, 30.0),
            "tension": ColourScale("tension along the tendons", "N", 1.0, 0.0, most),
        }[shade]

    def frames(self, path: Solution, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        """Return the frames as `Drawable.frames`."""
        cables, turn = self._parts.cables, rotation_about_z(self._body.turn).T
        start = undeformed_state(self._parts, np.empty((0, 0, 0, 6)))
        slip, distal, tendons, drawn = start.slip, start.distal, unloaded_tendons(cables), []
        for q, tension in zip(path.q, path.tension, strict=True):
            u = q.reshape(-1, 3)
            trace_tendons(cables, u, slip, distal, float(route.mu), float(route.presliding), tendons)
            slip, distal = tendons.slip.copy(), tendons.distal.copy()
            points = (cables.rest + cables.weights @ u) @ turn
            piece = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
            skin = self._skin + self._weights @ u
            along = (tension[:, None] * tendons.share).ravel()
            lines, change = self._cords(u, turn)
            shapes = FrameShapes(tendon_pieces=piece, tension=along, skin=skin @ turn, strain=self._strain(skin))
            drawn.append(shapes._replace(cord_pieces=lines, resistance=change))
        return stack_frames(drawn, path.markers)

    def _cords(self, u: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the cords' pieces (c, 2, 3) m at nodes' displacements u (n_free, 3) m, and their R/R0 - 1 (c,)."""
        line, signals = self._statics.cord_paths(u[None])[0] @ turn, self._statics.sensor_signals(u[None])
        pieces = np.stack([line[:, :-1], line[:, 1:]], axis=2)
        return pieces.reshape(-1, 2, 3), np.repeat(signals["sensor"][0] / signals["sensor_rest"][0] - 1.0, pieces.shape[1])

    def _strain(self, skin: np.ndarray) -> np.ndarray:
        """Return the strain (v,) along the finger, at each point the mean of the pieces that meet there."""

        def spans(x: np.ndarray) -> np.ndarray:
            return np.linalg.norm(np.diff(x[:-1].reshape(DRAWN_RINGS, DRAWN_AROUND, 3), axis=0), axis=2)

        e = spans(skin) / spans(self._skin) - 1.0
        at = np.concatenate([e[:1], 0.5 * (e[1:] + e[:-1]), e[-1:]]).ravel()
        return np.append(at, at[-DRAWN_AROUND:].mean())


class HandFigure:
    """`Drawable` of a hand: the fingers' own, each in its place, and the palm."""

    colour_fields = SoftFigure.colour_fields
    solids: tuple[Solid, ...] = ()
    view = np.zeros(3)

    def __init__(self, body: HandBody) -> None:
        self._body, self._fingers = body, [SoftFigure(finger) for finger in body.fingers]
        radius = float(np.linalg.norm(body.places[:, :2], axis=1).max())
        self.cylinders, self.link_colours = np.array([[radius, PALM_THICKNESS]]), np.array([PALM_COLOUR], np.uint8)
        self.height, self.middle, self.tip = self._fingers[0].height, self._fingers[0].middle, -1
        n = self._fingers[0].faces.max() + 1
        self.faces = np.concatenate([f.faces + k * n for k, f in enumerate(self._fingers)]).astype(np.uint32)
        angle = np.arctan2(body.turns[:, 1, 0], body.turns[:, 0, 0])
        self.push_points = np.concatenate([f.push_points + np.array([0.0, angle[k], k]) for k, f in enumerate(self._fingers)])

    def push_positions(self, shown: Frames) -> np.ndarray:
        """Return positions as `Drawable.push_positions`."""
        each = np.split(shown.skin[0], len(self._fingers))
        return np.concatenate([skin[:-1] for skin in each])

    def colour_scale(self, shade: str, most: float) -> ColourScale:
        """Return the scale as `Drawable.colour_scale`."""
        return self._fingers[0].colour_scale(shade, most)

    def frames(self, path: Solution, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        """Return the frames as `Drawable.frames`."""
        assert isinstance(path, HandSolution)
        each = enumerate(zip(self._fingers, path.fingers, strict=True))
        drawn = [finger.frames(solution, self._body.finger_loads(k, loads), route) for k, (finger, solution) in each]
        n = len(path.markers)

        def placed(name: str) -> np.ndarray:
            of = zip(drawn, self._body.turns, self._body.places, strict=True)
            return np.concatenate([getattr(frames, name) @ turn.T + place for frames, turn, place in of], axis=1)

        palm = np.tile([0.0, 0.0, -PALM_THICKNESS], (n, 1, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1, 1))
        values = {name: np.concatenate([getattr(f, name) for f in drawn], axis=1) for name in self.colour_fields}
        points = {name: placed(name) for name in ("tendon_pieces", "skin", "cord_pieces")}
        return replace(drawn[0], link_positions=palm[0], link_quaternions=palm[1], markers=path.markers, **values, **points)
