"""A fitted model, its evidence, and its refits."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.calibration.fit import Fit, StopRule, fit
from twin.diagnosis.calibration.model import Free, Model
from twin.diagnosis.calibration.objective import Evaluation
from twin.diagnosis.checks.fit_warnings import unlikely
from twin.diagnosis.checks.zero_jumps import of_robot
from twin.diagnosis.evidence.discrepancy import Discrepancy
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import MOST_DOUBLINGS, REFIT_SCORE_TOLERANCE, REFIT_TOLERANCE
from twin.effects import FitStart, catalogue
from twin.effects.base.scaling import scaled_extended_starts, scaled_parameters
from twin.foundation.errors import SolveError

EffectForms = tuple[tuple[str, str], ...]  # effect and its form, sorted; the key of a set of effects


@dataclass(frozen=True)
class ScoredModel:
    """A fitted model and its evidence, up to a constant.

    `score` = 2 max log N(z; 0, I + Phi D Phi') - prior terms - k log n - `unheard`, where `unheard` is the input noise that the
    effects keep from the robot (`FitContext.blocked_input_noise`).
    """

    fit: Fit
    score: float
    discrepancy: Discrepancy
    unheard: float = 0.0

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the robot, without the jumping zeros of this recording."""
        return tuple(sorted(e.id for e in of_robot(self.fit.model.twin.effects)))

    @property
    def forms(self) -> EffectForms:
        """The effects, each with its form."""
        free = {e: tuple(f.parameter.name for f in self.fit.model.free if f.effect == e) for e in self.effects}
        return tuple((e, catalogue()[e].form(free[e])) for e in self.effects)

    def forms_without(self, effect: str) -> EffectForms:
        return tuple(law for law in self.forms if law[0] != effect)


def score_model(context: FitContext, fitted: Fit) -> ScoredModel:
    """Return a fit with its score."""
    gain, discrepancy = context.evidence.log_likelihood_gain(fitted.z)
    prior = fitted.cost - float(fitted.z @ fitted.z)
    size = fitted.effective_parameters() * float(np.log(context.objective.n))
    unheard = context.blocked_input_noise(fitted)
    return ScoredModel(fitted, gain - unheard - prior - size, discrepancy, unheard)


def with_effect_added(
    context: FitContext, member: ScoredModel, effect: str, start: FitStart, beat: float = np.inf
) -> ScoredModel | None:
    """Return `member` with one effect more, fitted as long as it may `beat` a cost; None without an equilibrium.

    Signed amplitudes take a step before the parameters of their shape: the influence of a shape is proportional to its amplitude,
    and from a drift of the wrong sign the first step could reach any shape. Where numbers of the robot went to their bounds for
    want of the effect, or those of a motion are unlikely, the fit starts from the numbers as described. Amplitudes
    of a motion's effect begin where they bring it nearest to the data.
    """
    n_tendon, model, near, J = context.prepared.n_tendon, member.fit.model, member.fit.evaluation, member.fit.J
    if _bent(context, member.fit):
        model, near, J = _as_described(model), None, None
    values = dict(start.values)
    try:
        if signed := _signed(effect, start, n_tendon):
            amplitudes = model.with_effect(effect, values, signed, n_tendon)
            begun = fit(context.objective, amplitudes, near=near, J=J, stop=StopRule(worth=np.inf))
            values = dict(next(e for e in begun.model.twin.effects if e.id == effect).values)
            model, near = begun.model.without_effect(effect), begun.evaluation
        elif context.objective.bends:
            values = _begun(context, model, near, effect, start)
        model = model.with_effect(effect, values, start.free, n_tendon)
        stop = StopRule(REFIT_TOLERANCE, REFIT_SCORE_TOLERANCE, beat)
        return score_model(context, fit(context.objective, model, near=near, J=J, stop=stop))
    except SolveError:
        return None


def _begun(context: FitContext, model: Model, at: Evaluation | None, effect: str, start: FitStart) -> dict[str, float]:
    """Return the values of a start, its amplitudes scaled from OFF by the power of two that brings a motion nearest to the data.

    A joint that sticks for good shows no derivative to less friction, and one that rests at its stop none to a spring. Limits,
    whose OFF is out of reach, stay; so does all where nothing is nearer than the motion without the effect. Raise SolveError where
    that is lost.
    """
    n_tendon, law, begun = context.prepared.n_tendon, catalogue()[effect], start.values
    each = {p.name: p for p in scaled_parameters(law, n_tendon, context.prepared.robot.size)}
    scaled = [n for n in begun if n not in law.inactive_when_off and abs(each[n].value) < abs(begun[n])]
    before = (at or context.objective.evaluate(model)).z if scaled else np.zeros(0)
    best, least = dict(begun), float(before @ before)
    for power in range(-MOST_DOUBLINGS, MOST_DOUBLINGS + 1) if scaled else ():
        far = {n: each[n].value + (begun[n] - each[n].value) * 2.0**power for n in scaled}
        values = {**begun, **{n: min(max(x, each[n].low), each[n].high) for n, x in far.items()}}
        with suppress(SolveError):
            nearer = context.objective.within(least, model.with_effect(effect, values, (), n_tendon))
            if nearer is not None:
                best, least = values, float(nearer.z @ nearer.z)
    return best


def described(context: FitContext, member: ScoredModel) -> ScoredModel | None:
    """Return the model of a motion with the robot's own numbers as described, where these were bent for want of an effect.

    Else None, as where the motion is lost. It is not fitted; its derivatives are its own.
    """
    if not (context.objective.bends and _bent(context, member.fit)):
        return None
    model = _as_described(member.fit.model)
    try:
        at = context.objective.evaluate(model)
        J = context.objective.jacobian(at, range(len(model.free)))
    except SolveError:
        return None
    return score_model(context, Fit(at, J, float(at.z @ at.z)))


def _bent(context: FitContext, fitted: Fit) -> bool:
    """Return whether numbers of the robot were bent for want of an effect: one is at its bound, or, of motion, unlikely."""
    ended = any(ended and f.effect is None for f, ended in zip(fitted.model.free, fitted.at_bound(), strict=True))
    return ended or (context.objective.bends and bool(unlikely(fitted)))


def _as_described(model: Model) -> Model:
    """Return the model with the robot's own free parameters at their described values."""
    x = [f.parameter.value / f.parameter.step if f.effect is None else v for f, v in zip(model.free, model.vector(), strict=True)]
    return model.at(np.array(x))


def _signed(effect: str, start: FitStart, n_tendon: int) -> tuple[str, ...]:
    """Return the signed amplitudes of a start that frees the parameters of a shape too."""
    law = catalogue()[effect]
    if not set(start.free) & set(law.inactive_when_off):
        return ()
    table = {p.name: p for p in law.all_parameters(n_tendon)}
    return tuple(n for n in start.free if n not in law.inactive_when_off and table[n].low < table[n].value)


def with_extended_law(context: FitContext, found: ScoredModel, accept: float) -> ScoredModel:
    """Return the model with the extended equation of an effect (a second creep time), where the data support it.

    Where an extended equation is in force, try one that contains it and more (an own value for each spring). This comes before
    other effects are added, which would otherwise be fitted to what the simple equation leaves. Where the simple equation bent the
    numbers of a robot in motion, the fit starts from the numbers as described.
    """
    n_tendon, parts = context.prepared.n_tendon, context.prepared.robot.build().features
    for effect in found.effects:
        richer = catalogue()[effect].extended_parameters
        free = tuple(f.parameter.name for f in found.fit.model.free if f.effect == effect)
        if not richer or not catalogue()[effect].extended_needs <= parts:
            continue
        plain, in_force = found, set(richer) & set(free)
        law = next(e for e in plain.fit.model.twin.effects if e.id == effect)
        predicted = [t.true for t in plain.fit.evaluation.traces.values()]
        starts = scaled_extended_starts(law, predicted, context.prepared.robot.size)
        starts = [s for s in starts if in_force <= set(s.free) and not set(s.free) <= set(free)]
        if not starts:
            continue
        if not context.budget.allows(f"the extended equation of {effect}"):
            continue
        context.progress(f"extended equation of {effect}")
        for start in starts:
            values, freed = {**law.values, **start.values}, tuple(dict.fromkeys((*free, *start.free)))
            model, J = plain.fit.model, _own(plain.fit)
            if context.objective.bends and _bent(context, plain.fit):
                model, J = _as_described(model), None
            model = model.without_effect(effect).with_effect(effect, values, freed, n_tendon)
            try:
                stop = StopRule(REFIT_TOLERANCE, REFIT_SCORE_TOLERANCE)
                extended = score_model(context, fit(context.objective, model, J=J, stop=stop))
            except SolveError:
                continue
            if extended.score > max(found.score, plain.score + accept):
                found = extended
    return found


def without_idle_numbers(context: FitContext, found: ScoredModel) -> ScoredModel:
    """Return the model of a motion with those numbers of joints and tendons OFF that are worth less than a fit's last step.

    A stop just beyond what the fitted trials reach takes nothing off their error; trials that nobody fitted may run into it. A
    fit does not see this where the numbers stand: derivatives there are those of a last touch, or zero. In statics all
    numbers stay: derivatives tell there.
    """
    for effect in found.effects if context.objective.bends else ():
        law = catalogue()[effect]
        each = {p.name for p in law.all_parameters(context.prepared.n_tendon)} - {p.name for p in law.parameters}
        many = [f for f in found.fit.model.free if f.effect == effect and f.parameter.name in each - set(law.inactive_when_off)]
        for number in many:
            if sum(f in many for f in found.fit.model.free) > 1:
                found = _with_off(context, found, number)
    return found


def _with_off(context: FitContext, found: ScoredModel, number: Free) -> ScoredModel:
    """Return the model with a free number OFF, if |z|^2 rises by `REFIT_SCORE_TOLERANCE` at most, else the model itself."""
    fitted, i = found.fit, found.fit.model.free.index(number)
    x = fitted.model.vector()
    x[i] = number.parameter.value / number.parameter.step
    model = Model(fitted.model.at(x).twin, tuple(f for f in fitted.model.free if f is not number))
    try:
        off = context.objective.within(float(fitted.z @ fitted.z) + REFIT_SCORE_TOLERANCE, model, fitted.evaluation.traces)
    except SolveError:
        return found
    if off is None:
        return found
    cost = fitted.cost - float(fitted.z @ fitted.z) + float(off.z @ off.z)
    return score_model(context, Fit(off, np.delete(fitted.J, i, axis=1), cost, trust=fitted.trust))


def refit_without(
    context: FitContext, base: ScoredModel, best: ScoredModel, effect: str, known: Sequence[ScoredModel] = ()
) -> ScoredModel:
    """Return the best set less one effect, with everything else fitted again.

    A robot fitted with the effect may have no equilibrium without it, where lengths are held. Then the fit starts from the base's
    robot; where that has none under the other effects, return the base itself. A fit of motion, which is dear, goes on from that
    of the same effects among the `known` ones.
    """
    context.progress(f"without {effect}")
    rest = next((w.fit for w in known if context.objective.bends and w.forms == best.forms_without(effect)), None)
    if rest is not None:
        stop = StopRule(worth=REFIT_SCORE_TOLERANCE)
        return score_model(context, fit(context.objective, rest.model, near=rest.evaluation, J=rest.J, stop=stop))
    keep = [i for i, f in enumerate(best.fit.model.free) if f.effect != effect]
    model = best.fit.model.without_effect(effect)
    as_calibrated = Model(replace(model.twin, values=base.fit.model.twin.values), model.free)
    for start, J in ((model, best.fit.J[:, keep]), (as_calibrated, _own(base.fit))):
        try:
            return score_model(context, fit(context.objective, start, J=J, stop=StopRule(worth=REFIT_SCORE_TOLERANCE)))
        except SolveError:
            continue
    return base


def better(found: ScoredModel, than: ScoredModel) -> bool:
    """Return whether one of two fits of the same effects is the better one.

    With the same free parameters both are minima of one cost, and the lower one is the better; else the score decides.
    """
    if set(found.fit.model.free) == set(than.fit.model.free):
        return found.fit.cost < than.fit.cost
    return found.score > than.score


def _own(fitted: Fit) -> np.ndarray:
    """Return the derivatives for the robot's own parameters, which come first."""
    return fitted.J[:, [i for i, f in enumerate(fitted.model.free) if f.effect is None]]
