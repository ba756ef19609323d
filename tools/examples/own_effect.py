"""An effect of your own: a law in one class, put into a twin and compared with a measurement.

In twin/effects the same class, in a file of its name, is found, screened, fitted, reported and tested by itself.
"""

import numpy as np

import twin
from twin.body import Signals
from twin.effects import Effect
from twin.foundation.parameters import Parameter


# %% The law: every cell reads too much by a share that grows with the session.
class WarmAmplifier(Effect):
    """Readings true * (1 + rate * time) of all load cells, time in hours since the first trial."""

    id = "warm_amplifier"
    parameters = (Parameter("rate", 0.0, "1", -0.5, 0.5, "share an hour; instrument amplifiers", scale=0.01),)
    moves_with, plot_against = "the time of day", "clock"

    def sense(self, true: Signals) -> Signals:
        return true.with_changes(tension=true.tension * self._gain(true.clock))

    def command(self, reported: Signals) -> Signals:
        return reported.with_changes(tension=reported.tension / self._gain(reported.clock))

    def _gain(self, clock: np.ndarray) -> np.ndarray:
        return 1.0 + self["rate"] * clock[:, None] / 3600.0


def main(trials: int = 3) -> None:
    # %% A day, and the twin of its robot with the law at three sizes.
    recording = twin.read(twin.sample("friday"))
    recording = recording.select(range(trials))
    described = twin.Twin.load("continuum")
    for rate in (0.0, 0.05, 0.1):
        error = twin.evaluate(described.with_effect(WarmAmplifier(rate=rate)), recording)
        for kind, block in error["by_kind"].items():
            print(f"{100 * rate:3.0f} % an hour: {kind} {block['rmse']:.3f} {block['unit']}")


if __name__ == "__main__":
    main()
