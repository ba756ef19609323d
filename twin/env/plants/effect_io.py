"""Apply effects to commands on their way to the tendons and to signals on their way back, over an episode so far.

Effects see the whole episode, as they see a trial: lag, drift and hysteresis continue from step to step, and a delay answers with
the command of then.
"""

from collections.abc import Mapping

import numpy as np

from twin.body import Body, Drive, Signals
from twin.effects.base.chain import EffectChain
from twin.prediction.prepared import ROOM_TEMPERATURE


class EffectIO:
    """The effects between the commands of tendons, all of one kind, and a body.

    The whole past is kept where an effect depends on it, else the last two instants. Tensions and displacements go straight from
    one command to the next; a current holds from when it is commanded.
    """

    def __init__(self, effect_chain: EffectChain, drive: Drive, body: Body) -> None:
        self._chain, self._body, self.drives = effect_chain, body, (drive,) * body.n_tendon
        geared = effect_chain.train.acts
        self._acts = geared or any(e.acts_in("command", "drive") for e in effect_chain.effects)
        self._senses = geared or any(e.acts_in("sense") for e in effect_chain.effects)
        self.time: list[float] = []
        self._commands: list[np.ndarray] = []
        self.actuated: list[np.ndarray] = []
        self._truths: list[tuple[np.ndarray, np.ndarray, np.ndarray, Mapping[str, np.ndarray]]] = []

    def apply_to_command(self, time: float, command: np.ndarray) -> np.ndarray:
        """Return the command (n_tendon,) N, m or A that reaches the tendons at `time` (s), given the one until then."""
        holds = self.drives[0] is Drive.CURRENT and bool(self.time)
        command = np.array(command, float)
        if holds:  # from the time before on
            self._commands[-1] = command
        self.time.append(time)
        self._commands.append(command)
        last = 2 if holds else 1
        actuated = np.array(self._commands[-last:])
        if self._acts:
            actuated = self._chain.drive(self._chain.command(self._signals(self._commands, slice(0, None)))).command[-last:]
        self.actuated[len(self.time) - last :] = self._body.borne(actuated) if self.drives[0] is Drive.TENSION else actuated
        return self.actuated[-1]

    def record_truth(
        self, tension: np.ndarray, displacement: np.ndarray, markers: np.ndarray, others: Mapping[str, np.ndarray] | None = None
    ) -> None:
        """Record the true signals at the last command's time.

        Tension (n_tendon,) N, displacement (n_tendon,) m, markers (n_marker, 3) m in their frame, and further signals (n_port,) by
        group.
        """
        self._truths.append((tension, displacement, markers, others or {}))
        if not (self._acts or self._senses):
            for kept in (self.time, self._commands, self.actuated, self._truths):
                del kept[:-2]

    def read_sensors(self) -> Signals:
        """Return the sensors' signals for the last record, at its last sample."""
        n = len(self._truths)
        rows = slice(0 if self._senses else n - 1, n)
        tension, displacement, markers, others = zip(*self._truths[rows], strict=True)
        true = self._signals(self.actuated, rows).with_changes(
            tension=np.array(tension), displacement=np.array(displacement), markers=np.array(markers),
            others={group: np.array([o[group] for o in others]) for group in others[0]},
        )  # fmt: skip
        return self._chain.sense(true) if self._senses else true

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the past as arrays by name, a row a sample."""
        tension, displacement, markers, others = zip(*self._truths, strict=True)
        past = {
            "time": self.time, "commands": self._commands, "actuated": self.actuated, "tension": tension,
            "displacement": displacement, "markers": markers,
        }  # fmt: skip
        past |= {f"signal.{group}": [o[group] for o in others] for group in others[0]}
        return {name: np.array(rows) for name, rows in past.items()}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue after a saved past."""
        self.time = state["time"].tolist()
        self._commands, self.actuated = list(state["commands"].copy()), list(state["actuated"].copy())
        signals = {name.removeprefix("signal."): a for name, a in state.items() if name.startswith("signal.")}
        others = [{group: a[i].copy() for group, a in signals.items()} for i in range(len(self.time))]
        truths = (state[name].copy() for name in ("tension", "displacement", "markers"))
        self._truths = list(zip(*truths, others, strict=True))

    def _signals(self, command: list[np.ndarray], rows: slice) -> Signals:
        """Return signals of some samples, with this command (n_tendon,) N, m or A each."""
        now, driving = np.array(self.time[rows]), np.array(command[rows])
        n = len(driving)
        of = {kind: driving if kind is self.drives[0] else np.zeros_like(driving) for kind in Drive}
        return Signals(
            now, now, of[Drive.TENSION], of[Drive.DISPLACEMENT], np.zeros((n, 0, 3)), np.full(n, ROOM_TEMPERATURE), self.drives,
            of[Drive.CURRENT],
        )  # fmt: skip
