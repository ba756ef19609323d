"""A correction of the score for load-cell noise that static friction keeps from moving the robot.

Below sliding, a tendon with friction does not move under the noise of its tension reading. An extra effect that moves it less thus
gains |z|^2 although it need not be true. The amount depends on travel, slip and tension in each row, without a closed form. The
twin is therefore simulated again with additional noise.
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
    """Return the extra input noise (in |z|^2) that `with_it` blocks compared with `without`, beyond `ScoredModel.unheard`.

    Zero if either model has no friction, if the total input noise could not change the ranking, or if a perturbed run has no
    equilibrium.
    """
    input_noise = sum(float(h.sum()) for h in context.objective.whitener.input_noise_energy)
    if not with_it.score - without.score < input_noise or not all(
        w.fit.model.twin.effect_chain.route.mu > 0.0 for w in (with_it, without)
    ):
        return 0.0
    try:
        not_blocked = [w.unheard + resimulated_noise(context, w.fit) for w in (with_it, without)]
    except SolveError:
        return 0.0
    return max(0.0, not_blocked[1] - not_blocked[0])


def resimulated_noise(context: FitContext, fit: Fit) -> float:
    """Return |z|^2 of the motion caused by additional noise on the readings.

    The mean of `FRICTION_NOISE_DRAWS` draws, the same ones for every set. Raise SolveError.
    """
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
