"""What a diagnosis concludes before the sealed trials are opened."""

from dataclasses import dataclass

from twin.diagnosis.calibration.objective import noise_under
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
    """What each stage handed on."""

    context: FitContext
    screening: Screening
    found: Search
    gated: Gated
    judged: Judgement
    notices: tuple[str, ...]

    @property
    def base(self) -> Twin:
        """The calibrated robot, no effect added."""
        return self.found.base.fit.model.twin

    @property
    def final(self) -> Twin:
        """The twin the verdict leaves in force."""
        return self.judged.final.fit.model.twin

    def noise(self) -> Noise:
        """The noise of the fitted trials under the final twin; that of the objective where a command beside theirs has no
        equilibrium."""
        try:
            return noise_under(self.context.objective, self.judged.final.fit.evaluation)
        except SolveError:
            return self.context.objective.whitener.noise

    def without(self, effect: str) -> Twin:
        """The final twin less one effect, everything else fitted again; itself where the effect is not claimed."""
        claimed = any(c.effect == effect for c in self.judged.claims)
        return self.gated.without[effect].fit.model.twin if claimed else self.final

    def weighed(self, effects: tuple[str, ...]) -> Twin | None:
        """The twin of a set of effects that the search weighed."""
        return next((w.fit.model.twin for w in self.found.all if w.effects == tuple(sorted(effects))), None)
