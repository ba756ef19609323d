"""Steps an exported rod with the laws of its twin, as the twin's own rollout."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from twin.body import Drive, Loads, Problem, Signals
from twin.body.hinge_chain import HingeChain
from twin.effects import Effect
from twin.foundation.errors import DataError, SolveError, short_repr
from twin.mechanics.rod.dynamics import ChainMotion, Dynamics
from twin.prediction.mjcf.chain import chain_of
from twin.prediction.prepared import ROOM_TEMPERATURE
from twin.prediction.storage import read_twin

TWIN_FILE = "twin.toml"  # beside the model: the laws that MuJoCo has not
_SHOWN = ("marker", "displacement", "tension")  # groups of what is read
Law = Callable[[np.ndarray, float], np.ndarray]  # commands (n_tendon,) N and time s to those delivered


class ChainStepper:
    """An exported rod in motion, from row to row of tensions: those of `twin rollout`, to rounding.

    The model is that of `robot.xml`, friction, creep and the true elastic moment come from `twin.toml` beside it. Tensions run
    straight from row to row. Steps are MuJoCo's, as long as the file's timestep or shorter where friction asks for it.

        stepper = ChainStepper("robot.xml", rate=50.0)
        stepper.reset(tension)
        while True:
            stepper.step(tension)
            stepper.readings()["tip_x"]
    """

    def __init__(self, path: str | Path, rate: float = 50.0) -> None:
        """Read the file and the twin beside it; `rate` is that of the rows, Hz.

        Raises DataError for a file that does not load, or is not that of the twin, and a rate that is not above zero.
        """
        path = Path(path)
        if not (np.isfinite(rate) and rate > 0.0):
            raise DataError(f"a rate of {rate:g} Hz; a number above zero is needed")
        self.twin, self.rate = read_twin(path.parent / TWIN_FILE), rate
        body = self.twin.body()
        if not isinstance(body, HingeChain):
            raise DataError(
                f"{short_repr(str(path), 300)}: robot {self.twin.robot.name!r} is no rod, which is what is stepped here; give "
                "ModelStepper the file of an MJCF"
            )
        try:
            spec = mujoco.MjSpec.from_file(str(path))
            self._body = chain_of(spec, body)
            self._dynamics = Dynamics(self._body)
        except (ValueError, KeyError, mujoco.FatalError) as error:
            raise DataError(f"{short_repr(str(path), 300)}: {' '.join(str(error).split())}; export it again") from None
        self.reset(np.zeros(body.n_tendon))

    @property
    def model(self) -> mujoco.MjModel:
        """The model that is stepped: the file's with its tendons divided at their holes."""
        return self._motion.model

    @property
    def data(self) -> mujoco.MjData:
        """Its state."""
        return self._motion.data

    def reset(self, tension: np.ndarray) -> None:
        """Begin as a rollout does: at rest in equilibrium under tensions (n_tendon,) N. Raises SolveError where there is none."""
        chain, self._row = self.twin.effect_chain, 0
        first = np.asarray(tension, float)
        self._laws, self._delivered = _laws(self.twin.effects, 1.0 / self.rate, first), first
        self._delivered = self._deliver(first)
        problem = Problem(
            np.zeros(1), self._delivered[None], chain.surround(Loads(self.twin.robot.gravity)), chain.route,
            (Drive.TENSION,) * len(first), chain.creep,
        )  # fmt: skip
        self._motion, self._route = ChainMotion(self._dynamics, problem), chain.route
        self._samples, _, _ = self._motion.run(problem.time, problem.command)

    def step(self, tension: np.ndarray) -> None:
        """Advance by a row under tensions (n_tendon,) N. Raises SolveError for a motion that is lost."""
        before, self._row = self._delivered, self._row + 1
        self._delivered = self._deliver(np.asarray(tension, float))
        time = np.array([self._row - 1.0, self._row]) / self.rate
        samples, _, ended = self._motion.run(time, np.stack([before, self._delivered]))
        if ended:
            raise SolveError(ended)
        self._samples = samples

    def readings(self) -> dict[str, float]:
        """Return markers (m), displacements (m) and tensions (N) by channel, as the camera, motors and load cells report them."""
        seen, body = self._samples, self._body
        tension = seen.tension[-1:]
        path = self._dynamics.straight_path - seen.path[-1:]
        true = _signals(
            self._row / self.rate, tension, path + self._route.elongation(tension), body.frame.to_marker_frame(seen.markers[-1:])
        )
        shown = self.twin.effect_chain.sense(true)
        senses = {name: s for name, s in body.senses.items() if s.group in _SHOWN and s.required_drive in (None, Drive.TENSION)}
        return {name: float(shown.group(s.group)[0, s.index, s.axis]) for name, s in senses.items()}

    def _deliver(self, tension: np.ndarray) -> np.ndarray:
        for law in self._laws:
            tension = law(tension, self._row / self.rate)
        return tension


def _laws(effects: tuple[Effect, ...], step: float, first: np.ndarray) -> list[Law]:
    """Return the laws of effects on tensions, in the order in which they act, called every `step` s from rest under the `first`."""
    laws: list[Law] = []
    for place, acting in (("command", reversed(effects)), ("drive", effects)):
        for effect in (e for e in acting if e.acts_in(place)):
            law = _law(effect, place, step, first)
            laws.append(law)
            first = first if place == "drive" else law(first, 0.0)
    return laws


def _law(effect: Effect, place: str, step: float, first: np.ndarray) -> Law:
    """Return an effect's law: its own from step to step, or of an effect without memory the law of a row."""
    if (own := effect.by_step(step, first)) is not None:
        return lambda tension, _: own(tension)
    of_row = effect.command if place == "command" else effect.drive
    return lambda tension, time: of_row(_signals(time, tension[None], np.zeros((1, tension.size)), np.zeros((1, 0, 3)))).command[0]


def _signals(time: float, tension: np.ndarray, displacement: np.ndarray, markers: np.ndarray) -> Signals:
    """Return one row of signals of tendons whose tension is given."""
    now = np.array([time])
    return Signals(
        now, now, tension, displacement, markers, np.full(1, ROOM_TEMPERATURE), (Drive.TENSION,) * tension.shape[1],
        np.zeros_like(tension),
    )  # fmt: skip
