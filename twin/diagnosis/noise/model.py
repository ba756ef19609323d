"""The noise model of sensors and driving readings, and the error that a perfect twin would leave."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording

DECLARED = "as declared"


@dataclass(frozen=True)
class Noise:
    """Standard deviations: sigma (n_output,) SI by channel; drive (n_tendon,) N or m of a driving reading.

    rho (n_output,) is the correlation of a row's noise with that of the row before; rho fade^(g-1) is that with the row g before.
    Noise is AR(1) where `fade` is rho or not given. Where it is more, white noise is added, and the share rho / fade is AR(1).
    """

    sigma: np.ndarray
    drive: np.ndarray
    rho: np.ndarray
    source: str
    fade: np.ndarray | None = None

    @property
    def lasting(self) -> tuple[np.ndarray, np.ndarray]:
        """The share (n_output,) of the noise's variance that is correlated, and its correlation from row to row."""
        fade = self.rho if self.fade is None else self.fade
        return np.divide(self.rho, fade, out=np.ones_like(self.rho), where=fade > 0.0), fade

    def in_means(self, rows: int) -> np.ndarray:
        """Return the standard deviation (n_output,) of the mean of many `rows`.

        Its square is sigma^2 (1 + 2 (rho + rho fade + ...)) / rows.
        """
        return self.sigma * np.sqrt((1.0 + 2.0 * self.rho / (1.0 - self.lasting[1])) / rows)

    @property
    def declared(self) -> bool:
        return self.source == DECLARED

    def floor(self, prepared: PreparedRecording, sensitivity: Sequence[np.ndarray]) -> dict[str, float]:
        """Return the RMS error that a perfect twin would still show, by group (m; Euclidean per marker).

        The noise of the sensors, and that of the driving readings through the sensitivities (n_k, n_output, n_tendon).
        """
        driven = np.mean([((G * self.drive) ** 2).sum(axis=2).mean(axis=0) for G in sensitivity], axis=0)  # (n_output,)
        floors = {}
        for group in dict.fromkeys(o.group for o in prepared.outputs):
            square = float(np.mean([self.sigma[j] ** 2 + driven[j] for j, o in enumerate(prepared.outputs) if o.group == group]))
            floors[group] = float(np.sqrt(square * (3.0 if OUTPUT_GROUPS[group].is_vector else 1.0)))
        return floors
