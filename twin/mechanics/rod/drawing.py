"""A backbone as it is drawn: MuJoCo's links and disks, tendons from hole to hole, and SMA springs behind the base."""

from dataclasses import replace

import mujoco
import numpy as np

from twin.body import Drive, Heating, Loads, Problem, Route, Solution
from twin.body.drawable import NO_PIECES, NO_VALUES, ColourScale, Frames, FrameShapes, Solid, stack_frames
from twin.body.drives.spring import Spring
from twin.body.hinge_chain import HingeChain
from twin.mechanics.rod import ChainSolution, Equilibrium
from twin.mechanics.rod.balance.chain import ContactLaw
from twin.mechanics.rod.tension_along import tension_along

# Elongations of springs are to scale; closed length and coil radius are not described and only for display. Lengths are shares of
# the robot's height.
CLOSED_SPRING_LENGTH, COIL_RADIUS, SIDES_PER_TURN = 0.04, 0.022, 12
SPRING_REACH = 3.0  # initial elongations from the base to a spring's fixed far end


class ChainFigure:
    """`Drawable` of a chain. Colours show the tension along the tendons and the temperature of SMA springs."""

    colour_fields: tuple[str, ...] = ("tension",)
    solids: tuple[Solid, ...] = ()
    view = np.zeros(3)

    def __init__(self, body: HingeChain, solver: Equilibrium) -> None:
        self._body, self._solver = body, solver
        self.faces = np.zeros((0, 3), np.uint32)
        self.cylinders = solver.model.geom_size[:, :2].copy()
        self.link_colours = (255 * solver.model.geom_rgba[:, :3]).astype(np.uint8)
        self.height, self.middle, self.tip = body.length, np.array([0.0, 0.0, 0.5 * body.length]), -1
        self._place(solver.model.qpos0)
        disks = solver.data.site_xpos[solver.chain.disk]
        self._disk = np.linalg.norm(solver.data.geom_xpos[None] - disks[:, None], axis=2).argmin(axis=1)
        self.push_points = np.column_stack([disks[:, 2] / body.length, np.zeros((len(disks), 2))])

    def push_positions(self, shown: Frames) -> np.ndarray:
        """Return positions as `Drawable.push_positions`."""
        return shown.link_positions[0, self._disk]

    def colour_scale(self, shade: str, most: float) -> ColourScale:
        """Return the scale as `Drawable.colour_scale`."""
        if shade == "temperature":
            return ColourScale(
                "temperature of the SMA springs", "degC", 1.0, 20.0, float(np.ceil((most - 273.15) / 20.0) * 20.0), 273.15
            )
        return ColourScale("tension along the tendons", "N", 1.0, -most if self._body.pushes else 0.0, most)

    def frames(self, path: Solution, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        """Return the frames as `Drawable.frames`."""
        nothing = np.zeros((1, path.tension.shape[1]))
        start, springs = Problem(np.zeros(1), nothing, loads, route), None
        if heating is not None:
            heating, springs = replace(heating, ambient=heating.ambient[:1]), heating.spring
            start = replace(start, drives=(Drive.CURRENT,) * nothing.size, heating=heating)
        began = self._solver.solve(start)
        law, slip = ContactLaw(float(route.mu), float(route.presliding), np.zeros(5)), (began.slip, began.distal)
        drawn = [
            self._instant(path, i, law, slip, _spring_elongations(path, i, self._solver, route, springs))
            for i in range(len(path.q))
        ]
        return stack_frames(drawn, self._body.frame.to_marker_frame(path.markers))

    def standing(self, path: ChainSolution, route: Route, springs: Spring) -> Frames:
        """Return the last instant of a solution, from its own slip states."""
        law, slip = ContactLaw(float(route.mu), float(route.presliding), np.zeros(5)), (path.slip.copy(), path.distal.copy())
        drawn = self._instant(path, -1, law, slip, _spring_elongations(path, -1, self._solver, route, springs))
        return stack_frames([drawn], self._body.frame.to_marker_frame(path.markers[-1:]))

    def _place(self, q: np.ndarray) -> None:
        self._solver.data.qpos[:] = q
        mujoco.mj_kinematics(self._solver.model, self._solver.data)

    def _instant(
        self, path: Solution, i: int, law: ContactLaw, slip: tuple[np.ndarray, np.ndarray], elongation: np.ndarray | None
    ) -> FrameShapes:  # fmt: skip
        """Return instant i, and advance `slip` to it."""
        data, chain = self._solver.data, self._solver.chain
        self._place(path.q[i])
        along = np.zeros_like(slip[0])
        tension_along(chain, law, self._body.borne(path.tension[i]), *slip, along)
        turn = np.empty((len(self.cylinders), 4))
        for g, matrix in enumerate(data.geom_xmat):
            mujoco.mju_mat2Quat(turn[g], matrix)
        ends = data.site_xpos[chain.hole]
        real = np.arange(along.shape[1]) < chain.n_piece[:, None]
        piece, tension = np.stack([ends[:, :-1], ends[:, 1:]], axis=2)[real], along[real]
        coil, warm = NO_PIECES, NO_VALUES
        if elongation is not None:
            lead, coils = self._spring_lines(ends[:, 0], elongation)
            piece, tension = np.concatenate([piece, lead]), np.concatenate([tension, along[:, 0]])
            coil, warm = coils.reshape(-1, 2, 3), np.repeat(path.others["temperature"][i], coils.shape[1])
        return FrameShapes(data.geom_xpos.copy(), turn, piece, tension, spring_pieces=coil, temperature=warm)

    def _spring_lines(self, hole: np.ndarray, elongation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return leads from the base's holes (n, 3) to the springs, and the coils' pieces.

        (n, 2, 3) m and (n, w, 2, 3) m.
        """
        n, h, turns = len(hole), self.height, 8
        long = CLOSED_SPRING_LENGTH * h + np.maximum(elongation[:, 0], 0.0)
        far = hole[:, 2] - CLOSED_SPRING_LENGTH * h - SPRING_REACH * elongation[:, 1]
        u = np.linspace(0.0, 1.0, turns * SIDES_PER_TURN + 1)
        around = 2.0 * np.pi * turns * u
        circle = COIL_RADIUS * h * np.stack([np.cos(around), np.sin(around)], axis=1)
        wire = np.empty((n, len(u), 3))
        wire[..., :2] = hole[:, None, :2] + circle
        wire[..., 2] = far[:, None] + long[:, None] * u
        lead = np.stack([hole, np.column_stack([hole[:, :2], far + long])], axis=1)
        return lead, np.stack([wire[:, :-1], wire[:, 1:]], axis=2)


def _spring_elongations(path: Solution, i: int, solver: Equilibrium, route: Route, springs: Spring | None) -> np.ndarray | None:
    """Return elongations (n_tendon, 2) m of the springs at sample i and on the straight robot; None without springs."""
    if springs is None:
        return None
    put_on = solver.zero_path(route, np.ones(len(path.path[i]), bool), springs)
    now = springs.initial_elongation + path.path[i] - put_on - route.elongation(path.tension[i])
    return np.column_stack([now, springs.initial_elongation])
