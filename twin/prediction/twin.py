"""A twin: a robot with parameters and effects, and its prediction of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from twin.body import Body, Heating, Solver
from twin.body.drawable import Drawable
from twin.body.drives.spring import Spring
from twin.effects import Effect, effect_class
from twin.effects.base.chain import EffectChain
from twin.foundation.errors import DataError
from twin.foundation.parameters import Values
from twin.measurements import Recording
from twin.measurements.channels import DERIVED_KINDS
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import is_dynamic, simulate
from twin.prediction.solver_pool import borrow_solver
from twin.robots import Robot, load, load_family


@dataclass(frozen=True)
class Twin:
    """A robot, the values of its parameters that differ from nominal, and the effects in force."""

    robot: Robot
    values: Values = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    def __hash__(self) -> int:
        return hash((self.robot.name, tuple(sorted(self.values.items())), self.effects))

    @staticmethod
    def of(robot: Robot | str) -> Twin:
        """Return the robot as described: nominal parameters, and the effects that its `robot.toml` declares."""
        robot = load(robot) if isinstance(robot, str) else robot
        return Twin(robot, {}, tuple(effect_class(name)(values, robot.n_tendon) for name, values in robot.effects))

    @staticmethod
    def of_recording(recording: Recording) -> Twin:
        """Return the robot that a recording names, as described. Raises DataError for a robot that is not found."""
        return Twin.of(load(recording.robot, recording.folder))

    @staticmethod
    def load(source: str | Path) -> Twin:
        """Read a twin from a `twin.toml`, a report's folder, a robot's folder or a robot's name. Raises as `read_twin`."""
        from twin.prediction.twin_file.storage import read_twin

        return read_twin(source)

    def save(self, path: str | Path) -> None:
        """Write the twin as a `twin.toml`, whole or not at all; parameters without standard errors."""
        from twin.prediction.provenance import run_provenance
        from twin.prediction.twin_file.storage import twin_table, write_twin

        path = Path(path)
        write_twin(path, twin_table(self, path.parent, {}, {}), run_provenance("Twin.save", 0, ""))

    def with_effect(self, effect: Effect) -> Twin:
        """Return the twin with this effect added, in the place of one of the same kind."""
        return replace(self, effects=(*(e for e in self.effects if e.id != effect.id), effect))

    @property
    def effect_chain(self) -> EffectChain:
        """The effects, applied in order, and the robot's own drive train."""
        return EffectChain(self.effects, self.robot.drive_train(self.values))

    def body(self) -> Body:
        """Return the robot's body, edited by its effects and not compiled yet. Raises DataError for an effect that finds nothing to
        act on."""
        body = self.robot.build(self.values)
        self.effect_chain.edit(body, self.robot.name)
        return body

    @contextmanager
    def statics(self) -> Iterator[tuple[Body, Solver]]:
        """Lend the body and the solver of its equilibria. Raises as `body`."""
        shaped = replace(self, effects=tuple(e for e in self.effects if e.acts_in("edit")))

        def made() -> tuple[Body, Solver]:
            body = shaped.body()
            return body, self.robot.solver(body)

        with borrow_solver(shaped, made) as (body, solver):
            self.effect_chain.check_body(body, self.robot.name)
            yield body, solver

    def heating(self, ambient: np.ndarray) -> Heating:
        """Return the SMA springs in surroundings at `ambient` (n,) K. Raises DataError where the robot describes none."""
        return Heating(ambient, self.springs())

    def springs(self) -> Spring:
        """Return the SMA springs with their effects. Raises DataError where the robot describes none."""
        return self.effect_chain.spring(self.robot.springs(self.robot.n_tendon, self.values))

    def predict(self, recording: Recording, *, dynamic: bool | None = None) -> Recording:
        """Return the recording with the twin's outputs, on its trials' samples and inputs; its `source` says so.

        Slow recordings are predicted by static equilibria, fast ones by MuJoCo steps (`dynamic`, or by the recording's rates).
        Raises DataError where the inputs do not determine the robot, SolveError where no equilibrium exists.
        """
        prepared = prepare(recording, self.robot)
        traces = simulate(self, prepared, dynamic=is_dynamic(prepared) if dynamic is None else dynamic)
        values = {
            inputs.name: _by_channel(prepared, trace.outputs(self, prepared))
            for inputs, trace in zip(prepared.inputs, traces, strict=True)
        }
        compared = prepared.recording
        return compared.with_values([values[t.name] for t in compared.trials], f"simulation: twin of {self.robot.name}")

    def figure(self) -> Drawable:
        """Return the drawable of its robot. Raises DataError for a family that is not drawn."""
        draw = load_family(self.robot.family).figure
        if draw is None:
            raise DataError(f"robot {self.robot.name!r} is a {self.robot.family}, which is not drawn here yet; see `twin robots`")
        return draw(self.body())


def _by_channel(prepared: PreparedRecording, y: np.ndarray) -> dict[str, np.ndarray]:
    shown = {o.channel.name: column for o, column in zip(prepared.outputs, y.T, strict=True)}
    for o in prepared.orientations:
        shown |= o.readings(np.column_stack([shown[c.name] for c in o.turns]))
    made = {o.channel.name for o in prepared.outputs if o.channel.kind in DERIVED_KINDS}
    return {name: column for name, column in shown.items() if name not in made}
