"""An MJCF as it is drawn: its own geoms, body by body, and its spatial tendons, coloured by their tension."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy

import mujoco
import numpy as np

from twin.body import Heating, Loads, Route, Solution
from twin.body.drawable import ColourScale, Frames, FrameShapes, Shape, Solid, stack_frames
from twin.mechanics.mjcf.body import ModelBody

SHOWN_GROUPS = 3  # geoms of groups 0 to 2 are shown, as MuJoCo's viewer does; those that only collide are usually in 3
FLOOR_SHARE, FLOOR_THICKNESS = 0.5, 2e-3  # reaches: half a side of a floor without end, and how thick floors are drawn
LEAST_HEIGHT = 1e-3  # m
FLAT = 0.5  # cosine between a floor's normal and up, at least
_G = mujoco.mjtGeom
_KINDS = {
    int(_G.mjGEOM_SPHERE): "sphere", int(_G.mjGEOM_CAPSULE): "capsule", int(_G.mjGEOM_CYLINDER): "cylinder",
    int(_G.mjGEOM_BOX): "box", int(_G.mjGEOM_ELLIPSOID): "ellipsoid", int(_G.mjGEOM_MESH): "mesh", int(_G.mjGEOM_PLANE): "plane",
}  # fmt: skip
_PULLEY = -2  # in mjData.wrap_obj, where a tendon is led through a pulley


class ModelFigure:
    """`Drawable` of an MJCF. Links are its bodies, by colour; a tendon has one tension (friction along it is not shown)."""

    def __init__(self, body: ModelBody) -> None:
        self._model = model = copy(body.model)
        self._data = mujoco.MjData(model)
        self.tip, self.push_points, self.faces = body.tip, np.zeros((0, 3)), np.zeros((0, 3), np.uint32)
        self.cylinders, self.link_colours = np.zeros((0, 2)), np.zeros((0, 3), np.uint8)
        self.colour_fields = ("tension",) if body.tendon_sites else ()
        self._set(model.qpos0 if model.nkey == 0 else model.key_qpos[0])
        low, high = _bounds(model, self._data)
        self.height, self.middle = max(float((high - low).max()), LEAST_HEIGHT), 0.5 * (low + high)
        self.view = _common_axis(model, self._data)
        self._bodies, self.solids = _solids(model, self.height)
        self._points = [2 * int(n) + 1 for n in model.tendon_num]  # at most, of each tendon: a wrap has two

    def push_positions(self, shown: Frames) -> np.ndarray:
        """Return no positions: it is not pushed by hand."""
        return self.push_points

    def colour_scale(self, shade: str, most: float) -> ColourScale:
        """Return the scale as `Drawable.colour_scale`."""
        return ColourScale("tension of the tendons", "N", 1.0, 0.0, most)

    def frames(self, path: Solution, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        """Return the frames as `Drawable.frames`."""
        return self._frames(path.q, path)

    def turned(self, path: Solution, joints: Mapping[int, np.ndarray]) -> Frames:
        """Return the frames with some joints, by number, at other positions (n,), rad or m; NaN keeps the solution's."""
        q = path.q.copy()
        for joint, position in joints.items():
            at = self._model.jnt_qposadr[joint]
            q[:, at] = np.where(np.isfinite(position), position, q[:, at])
        return self._frames(q, path)

    def _frames(self, q: np.ndarray, path: Solution) -> Frames:
        tension, drawn = path.others["tendon tension"], []
        for row, pulled in zip(q, tension, strict=True):
            self._set(row)
            piece, each = self._tendons()
            place, turn = self._data.xpos[self._bodies], self._data.xquat[self._bodies]
            drawn.append(FrameShapes(place.copy(), turn.copy(), piece, pulled[each]))
        return stack_frames(drawn, path.markers)

    def _set(self, q: np.ndarray) -> None:
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_tendon(self._model, self._data)

    def _tendons(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the pieces (s, 2, 3) m of the spatial tendons, as many at any time, and the tendon of each."""
        data, pieces, of = self._data, [np.zeros((0, 2, 3))], [np.zeros(0, np.int64)]
        places, met = data.wrap_xpos.reshape(-1, 3), data.wrap_obj.reshape(-1)
        for t, most in enumerate(self._points):
            first, n = int(data.ten_wrapadr[t]), int(data.ten_wrapnum[t])
            if n < 2:
                continue
            at = places[first : first + n]
            real = (met[first : first + n - 1] != _PULLEY) & (met[first + 1 : first + n] != _PULLEY)
            found = np.stack([at[:-1], at[1:]], axis=1)[real]
            rest = np.repeat(at[None, None, -1], 2, axis=1).repeat(most - len(found), axis=0)  # without length
            pieces.append(np.concatenate([found, rest]))
            of.append(np.full(most, t))
        return np.concatenate(pieces), np.concatenate(of)


def _shown(model: mujoco.MjModel) -> np.ndarray:
    """Return the geoms that are drawn: those of the first groups, or all where these are none; of planes only floors."""
    can = np.array([int(kind) in _KINDS for kind in model.geom_type], bool).reshape(-1)
    can &= np.array([_is_no_wall(model, g) for g in range(model.ngeom)], bool).reshape(-1)
    usual = can & (model.geom_group < SHOWN_GROUPS) & (model.geom_rgba[:, 3] > 0.0)
    moving = model.body_weldid[model.geom_bodyid] != 0
    return np.flatnonzero(usual if (usual & moving).any() else can)


def _is_no_wall(model: mujoco.MjModel, g: int) -> bool:
    """Return whether a geom is no plane that stands, behind which nothing would be seen."""
    up, normal = -np.asarray(model.opt.gravity), np.empty(3)
    mujoco.mju_rotVecQuat(normal, np.array([0.0, 0.0, 1.0]), model.geom_quat[g])
    return bool(model.geom_type[g] != int(_G.mjGEOM_PLANE) or normal @ up >= FLAT * np.linalg.norm(up))


def _bounds(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (3,) m of a box about what moves, as it stands, and the way to the ground it stands on."""
    points = [np.zeros((1, 3))] if model.nbody < 2 else []
    for g in _shown(model):
        if model.geom_type[g] != int(_G.mjGEOM_PLANE) and model.body_weldid[model.geom_bodyid[g]] != 0:
            middle, half = model.geom_aabb[g, :3], model.geom_aabb[g, 3:]
            corners = middle + half * np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
            points.append(data.geom_xpos[g] + corners @ data.geom_xmat[g].reshape(3, 3).T)
    points += [data.site_xpos] if model.nsite else []
    points += [data.xpos[1:]] if model.nbody > 1 else []
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def _common_axis(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the axis (3,) that most hinges share, along which their motion is seen best; zero without hinges."""
    axes = data.xaxis[model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)]
    return np.linalg.eigh(axes.T @ axes)[1][:, -1] if len(axes) else np.zeros(3)


def _solids(model: mujoco.MjModel, height: float) -> tuple[np.ndarray, tuple[Solid, ...]]:
    """Return the shapes of each body and colour, and the bodies that they move with."""
    groups: dict[tuple[int, tuple[float, ...]], list[Shape]] = {}
    for g in _shown(model):
        colour = model.geom_rgba[g] if model.geom_matid[g] < 0 else model.mat_rgba[model.geom_matid[g]]
        groups.setdefault((int(model.geom_bodyid[g]), tuple(map(float, colour))), []).append(_shape(model, int(g), height))
    solids = tuple(
        Solid(tuple(shapes), (round(255 * r), round(255 * g), round(255 * b)), alpha, bool(model.body_weldid[body] != 0))
        for (body, (r, g, b, alpha)), shapes in groups.items()
    )
    return np.array([body for body, _ in groups], np.int64), solids


def _shape(model: mujoco.MjModel, g: int, height: float) -> Shape:
    kind, size, place, turn = _KINDS[int(model.geom_type[g])], model.geom_size[g], model.geom_pos[g], model.geom_quat[g]
    if kind == "plane":  # a flat box
        half = np.where(size[:2] > 0.0, np.minimum(size[:2], 2.0 * FLOOR_SHARE * height), FLOOR_SHARE * height)
        thick = FLOOR_THICKNESS * height
        down = np.empty(3)
        mujoco.mju_rotVecQuat(down, np.array([0.0, 0.0, -thick]), turn)
        return Shape("box", np.array([*half, thick]), place + down, turn.copy())
    if kind == "mesh":
        m = int(model.geom_dataid[g])
        v, f = int(model.mesh_vertadr[m]), int(model.mesh_faceadr[m])
        vertices = model.mesh_vert[v : v + model.mesh_vertnum[m]].astype(float)
        return Shape(kind, size.copy(), place.copy(), turn.copy(), vertices, model.mesh_face[f : f + model.mesh_facenum[m]].copy())
    return Shape(kind, size.copy(), place.copy(), turn.copy())
