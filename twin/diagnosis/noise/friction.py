"""What an effect beside friction gains by noise that friction stills, which the robot has never felt.

A tendon that rubs holds still under what its reading trembles by, the more so the farther from sliding it is, or the less it is
pulled: laws that move it there are paid for it in |z|^2 though they need not be true. How much depends on travel, slip and tension
row by row; no closed form tells, so that the twin is shaken by as much noise again.
"""

from dataclasses import replace

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import FRICTION_NOISE_DRAWS
from twin.foundation.errors import SolveError
from twin.prediction.simulate import SolveOptions, simulate


def noise_credit(context: FitContext, with_it: ScoredModel, without: ScoredModel) -> float:
    """By how much more of the readings' noise than `Weighed.unheard` tells, in |z|^2, the one set keeps from a robot whose tendons
    rub in both; 0 where they do not, where all the noise there is would not pay, or shaken the robot has no equilibrium."""
    heard = sum(float(h.sum()) for h in context.objective.whitener.input_noise_energy)
    if not with_it.score - without.score < heard or not all(
        w.fit.model.twin.effect_chain.route.mu > 0.0 for w in (with_it, without)
    ):
        return 0.0
    try:
        felt = [w.unheard + resimulated_noise(context, w.fit) for w in (with_it, without)]
    except SolveError:
        return 0.0
    return max(0.0, felt[1] - felt[0])


def resimulated_noise(context: FitContext, fit: Fit) -> float:
    """|z|^2 of what moves when as much noise is drawn onto the readings once more, in the mean of `FRICTION_NOISE_DRAWS` draws, the
    same ones for every set. Raises SolveError."""
    prepared, whitener, twin = context.prepared, context.objective.whitener, fit.model.twin
    rng, total = np.random.default_rng(0), 0.0
    at = [fit.evaluation.traces[k].outputs(twin, prepared) for k in context.trials]
    for _ in range(FRICTION_NOISE_DRAWS):
        inputs = tuple(
            replace(i, command=i.command + whitener.noise.drive * rng.normal(size=i.command.shape)) for i in prepared.inputs
        )
        traces = simulate(
            twin, replace(prepared, inputs=inputs), trials=context.trials, options=SolveOptions(fit.evaluation.traces)
        )
        moved = [t.outputs(twin, prepared) - y for t, y in zip(traces, at, strict=True)]
        total += sum(float((whitener.trial(k, d) ** 2).sum()) for k, d in enumerate(moved))
    return total / FRICTION_NOISE_DRAWS
