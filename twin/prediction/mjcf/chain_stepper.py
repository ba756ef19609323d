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
from twin.mechanics.rod.dynamics import ChainMotion, Dynamics, MotionSamples
from twin.prediction.mjcf.chain import chain_of
from twin.prediction.prepared import ROOM_TEMPERATURE
from twin.prediction.twin_file.storage import read_twin

TWIN_FILE = "twin.toml"  # beside the model: the laws that MuJoCo has not
_NO_MARKERS = np.zeros((1, 0, 3))
_SHOWN = ("marker", "displacement", "tension")  # groups of what is read
Law = Callable[[np.ndarray, float], np.ndarray]  # commands (n_tendon,) N and time s to those delivered


class ChainStepper:
    """An exported rod in motion under rows of tensions, as `twin rollout` predicts it, to rounding.

    The model is that of `robot.xml`; friction, creep and the true elastic moment come from `twin.toml` beside it. Tensions run
    straight from row to row. Steps are MuJoCo's, as long as the file's timestep, or shorter where friction asks for it. Row by row
    a lag or a delay knows no row to come, and takes commands as straight between rows, where a rollout (and `run`) smooths them.

        ChainStepper("robot.xml", rate=50.0).run(tensions)["tip_x"]
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

    def run(self, tensions: np.ndarray) -> dict[str, np.ndarray]:
        """Return the readings (n,) of a rollout under rows of tensions (n, n_tendon) N, apart from what is stepped.

        Raises SolveError where the motion is lost or has no start.
        """
        rows = np.asarray(tensions, float)
        time = np.arange(len(rows)) / self.rate
        chain = self.twin.effect_chain
        delivered = chain.drive(chain.command(_signals(time, rows, np.zeros_like(rows), _NO_MARKERS))).command
        samples, _, ended = self._start(delivered[0]).run(time, delivered)
        if ended:
            raise SolveError(ended)
        return self._read(time, samples)

    def reset(self, tension: np.ndarray) -> None:
        """Begin as a rollout does: at rest in equilibrium under tensions (n_tendon,) N.

        Raises SolveError where there is none, DataError for an effect that must know all rows.
        """
        self._row, first = 0, np.asarray(tension, float)
        self._laws = _laws(self.twin.effects, 1.0 / self.rate, first)
        self._delivered = self._deliver(first)
        self._motion = self._start(self._delivered)
        self._samples, _, _ = self._motion.run(np.zeros(1), self._delivered[None])

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
        now = MotionSamples(*(values[-1:] for values in self._samples))
        return {name: float(column[0]) for name, column in self._read(np.array([self._row / self.rate]), now).items()}

    def _start(self, first: np.ndarray) -> ChainMotion:
        """Return the motion from rest under tensions (n_tendon,) N."""
        chain = self.twin.effect_chain
        loads, drives = chain.surround(Loads(self.twin.robot.gravity)), (Drive.TENSION,) * len(first)
        return ChainMotion(self._dynamics, Problem(np.zeros(1), first[None], loads, chain.route, drives, chain.creep))

    def _read(self, time: np.ndarray, samples: MotionSamples) -> dict[str, np.ndarray]:
        """Return what is reported (n,) of samples at times (n,) s, by channel."""
        chain, body = self.twin.effect_chain, self._body
        travel = self._dynamics.straight_path - samples.path + chain.route.elongation(samples.tension)
        shown = chain.sense(_signals(time, samples.tension, travel, body.frame.to_marker_frame(samples.markers)))
        senses = {name: s for name, s in body.senses.items() if s.group in _SHOWN and s.required_drive in (None, Drive.TENSION)}
        return {name: shown.group(s.group)[:, s.index, s.axis] for name, s in senses.items()}

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
    """Return an effect's law: of an effect without memory the law of a row, else its own from step to step."""
    of_rows = effect.command if place == "command" else effect.drive

    def at(time: np.ndarray, rows: np.ndarray) -> np.ndarray:
        return of_rows(_signals(time, rows, np.zeros_like(rows), _NO_MARKERS)).command

    time, rows = np.array([0.0, step]), np.stack([first, first + 1.0])  # what the second row becomes, with and without the first
    if np.array_equal(at(time, rows)[1], at(time[1:], rows[1:])[0]):
        return lambda tension, now: at(np.array([now]), tension[None])[0]
    if (own := effect.by_step(step, first)) is None:
        raise DataError(f"effect {effect.id} must know all rows of tensions; give them to `run` at once, or remove the effect")
    return lambda tension, _: own(tension)


def _signals(time: np.ndarray, tension: np.ndarray, displacement: np.ndarray, markers: np.ndarray) -> Signals:
    """Return signals (n rows) of tendons whose tension is given, straight or smooth between rows as in a prediction."""
    n, n_tendon = tension.shape
    return Signals(
        time, time, tension, displacement, np.broadcast_to(markers, (n, *markers.shape[1:])), np.full(n, ROOM_TEMPERATURE),
        (Drive.TENSION,) * n_tendon, np.zeros_like(tension), smooth=True,
    )  # fmt: skip
