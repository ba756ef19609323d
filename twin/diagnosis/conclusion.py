"""The conclusion of a diagnosis before the held-out trials are used."""

from dataclasses import dataclass

from twin.diagnosis.calibration.first_calibration import noise_under
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.search.screen import Screening
from twin.diagnosis.search.search import Search
from twin.diagnosis.verdict.gate import Gated
from twin.diagnosis.verdict.judge import Judgement
from twin.foundation.errors import SolveError
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class Conclusion:
    """The results of all stages."""

    context: FitContext
    screening: Screening
    found: Search
    gated: Gated
    judged: Judgement
    notices: tuple[str, ...]

    @property
    def base(self) -> Twin:
        """The calibrated robot, without added effects."""
        return self.found.base.fit.model.twin

    @property
    def final(self) -> Twin:
        """The twin that the verdict leaves in force."""
        return self.judged.final.fit.model.twin

    def noise(self) -> Noise:
        """Estimate the noise of the fitted trials under the final twin.

        Return the objective's noise where a neighbouring command has no equilibrium.
        """
        try:
            return noise_under(self.context.objective, self.judged.final.fit.evaluation)
        except SolveError:
            return self.context.objective.whitener.noise

    def without(self, effect: str) -> Twin:
        """Return the final twin less one effect, with everything else fitted again.

        Return the final twin itself where the effect is not claimed.
        """
        claimed = any(c.effect == effect for c in self.judged.claims)
        return self.gated.without[effect].fit.model.twin if claimed else self.final

    def weighed(self, effects: tuple[str, ...]) -> Twin | None:
        """Return the twin of a candidate with these effects that the search has fitted; None where there is none."""
        return next((w.fit.model.twin for w in self.found.all if w.effects == tuple(sorted(effects))), None)
