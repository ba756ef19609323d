"""The objective of every fit: the whitened residuals of models on the fitted trials, and their derivatives.

Derivatives are finite differences. A difference costs a fraction of a prediction: a changed twin is solved from the equilibria and
tangents of the unchanged one, and one in motion is simulated in longer steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from joblib import Parallel, delayed

from twin.body import Drive
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.noise.whitening import Whitener
from twin.effects import Effect
from twin.foundation.errors import SolveError
from twin.prediction.prepared import PreparedRecording
from twin.prediction.simulate import SolveOptions, Trace, iterate_traces
from twin.prediction.twin import Twin

DERIVATIVE_TOLERANCE = 1e-6  # rad, for derivatives: 1e-4 mm against a change of some 1e-2 mm
PARAMETER_DIFFERENCE = 0.02  # of a parameter's step: small against curvature, large against the solver's tolerance
# The same of motion that jumps: where a joint comes to rest by friction moves by hundredths of a sigma with any change of any
# number; half a step moves predictions by about a sigma, and bends little.
MOTION_DIFFERENCE = 0.5
# Of derivatives along a move of all parameters: with such an error each step still leaves a tenth of the last.
COARSE_ERROR = 0.1
TRIALS_PROBED = 2  # to see which derivatives have changed
LARGEST_LAST_FALL = 3.0  # of |z|^2, by which a fit of motion ends: fast logs have so many rows that a share of them is a lot
# Of |z|^2 above the noise, by which a fit of motion may end where the model lacks an effect: errors (RMS) are then known to half a
# per cent. Derivatives by long steps leave the gradient there as inexact.
MISFIT_SHARE = 2e-3
CHANGED_SHARE = 0.05  # of a derivative, by which it changed too much to be kept

Unsolved = Literal["raise", "zeros", "nan"]


@dataclass(frozen=True)
class Differences:
    """How derivatives of motion are computed: in long steps or in short ones, by which difference (in a parameter's steps)."""

    long_steps: bool
    size: float


@dataclass(frozen=True)
class Evaluation:
    """A model's prediction of the fitted trials: traces by trial, raw residuals (n_k, n_output) SI, whitened residual flat (n,)."""

    model: Model
    traces: Mapping[int, Trace]
    raw: list[np.ndarray]
    z: np.ndarray


class Objective:
    """The residuals, whitened by `whitener`, and derivatives of models on the listed trials of a prepared recording."""

    def __init__(self, prepared: PreparedRecording, trials: Sequence[int], whitener: Whitener, jobs: int) -> None:
        self.prepared, self.trials, self.whitener, self.jobs = prepared, list(trials), whitener, jobs
        self.n = int(sum(np.isfinite(prepared.measured[k]).sum() for k in trials))
        self._differences: dict[frozenset[str], Differences] = {}  # of motion, by the effects in force
        self._coarse_error = COARSE_ERROR

    def precise(self) -> Objective:
        """Return the same objective with derivatives of motion by short steps alone.

        Those of long steps err by some per cent of a column, which in directions that only descriptions hold is more than these.
        """
        found = self.of(range(len(self.trials)))
        found._coarse_error = 0.0
        return found

    @property
    def bends(self) -> bool:
        """Whether derivatives for the robot's own parameters change so much with them that fits must renew them: of motion."""
        return Drive.CONTROL in getattr(self.prepared, "drives", ())

    def smallest_fall(self, share: float, square: float) -> tuple[float, float]:
        """Return the falls of |z|^2 at which a fit that stands at `square` may end: at its minimum, and near it.

        They are a share of it; of motion `LARGEST_LAST_FALL` at most, near the minimum `MISFIT_SHARE` of what exceeds the noise.
        """
        if not self.bends:
            return share * square, share * square
        least = min(share * square, LARGEST_LAST_FALL)
        return least, max(least, MISFIT_SHARE * (square - self.n))

    def of(self, which: Sequence[int]) -> Objective:
        """Return the objective of some of its trials, given by their positions."""
        part = Objective(self.prepared, [self.trials[k] for k in which], self.whitener.of(which), self.jobs)
        part._coarse_error = self._coarse_error
        return part

    def predict(
        self, twin: Twin, near: Mapping[int, Trace] | None = None, once: bool = False
    ) -> tuple[dict[int, Trace], list[np.ndarray]]:
        way = SolveOptions(near or {}, False, once, DERIVATIVE_TOLERANCE)
        traces = dict(iterate_traces(twin, self.prepared, self.trials, way))
        return traces, [traces[k].outputs(twin, self.prepared) for k in self.trials]

    def evaluate(self, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation:
        found = self.within(np.inf, model, near)
        assert found is not None
        return found

    def within(self, most: float, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation | None:
        """Return the evaluation of a model whose |z|^2 is `most` at most, else None.

        The prediction ends with the trial that exceeds `most`.
        """
        at, traces = {k: i for i, k in enumerate(self.trials)}, {}
        raw, z = [np.empty(0)] * len(at), [np.empty(0)] * len(at)
        # A body that creeps has a memory of the trials before.
        n = 1 if model.twin.effect_chain.creep.amplitude else min(self.jobs, len(at))
        shares = [self.trials[i::n] for i in range(n)]
        total = np.zeros(n)

        def solve(share: int) -> None:
            for k, trace in iterate_traces(model.twin, self.prepared, shares[share], SolveOptions(near or {}, keep=True)):
                traces[k] = trace
                if (i := at.get(k)) is not None:
                    raw[i] = self.prepared.measured[k] - trace.outputs(model.twin, self.prepared)
                    z[i] = self.whitener.trial(i, raw[i]).ravel()
                    total[share] += float(z[i] @ z[i])
                    if total.sum() > most:
                        return

        Parallel(n_jobs=n, prefer="threads", require="sharedmem")(delayed(solve)(s) for s in range(n))
        return None if total.sum() > most else Evaluation(model, dict(sorted(traces.items())), raw, np.concatenate(z))

    def cut_off(self, twin: Twin) -> np.ndarray:
        """Return the root of the input noise that effects clip near zero tension, flat (n_row n_tendon,).

        Its square is `Whitener.clipped_input_noise`.
        """
        pulled, cut = self.prepared.silenced_below_zero, []
        for i, k in enumerate(self.trials):
            tension = np.where(pulled, twin.effect_chain.command(self.prepared.inputs[k].signals).tension, np.inf)
            cut.append(np.sqrt(self.whitener.clipped_input_noise(i, tension)).ravel())
        return np.concatenate(cut)

    def white(self, raw: Sequence[np.ndarray]) -> np.ndarray:
        return np.concatenate([self.whitener.trial(k, r).ravel() for k, r in enumerate(raw)])

    def columns(
        self, at: Evaluation, models: Sequence[tuple[Model, float]], *, once: bool = False, unsolved: Unsolved = "raise"
    ) -> np.ndarray:
        """Return the whitened change of the residual per unit (n, n_model), for neighbouring models and the difference of each.

        `once` solves to first order in the difference; motion is simulated in long steps where these serve, else in short ones. A
        model without an equilibrium, or whose motion is lost, raises SolveError, or has a column of zeros or of NaN (`unsolved`).
        """
        if not models:
            return np.zeros((at.z.size, 0))
        before = self._coarsely(at) if self.bends else None

        def column(model: Model, size: float) -> np.ndarray:
            if _same_simulation(at.model.twin, model.twin):
                return self._change(at.raw, [at.traces[k].outputs(model.twin, self.prepared) for k in self.trials], size)
            try:
                if before is not None:
                    with suppress(SolveError):  # motion may be lost in long steps alone
                        return self._change(before, self.predict(model.twin, once=True)[1], size)
                return self._change(at.raw, self.predict(model.twin, at.traces, once=once and not self.bends)[1], size)
            except SolveError:
                if unsolved == "raise":
                    raise
                return np.full(at.z.size, 0.0 if unsolved == "zeros" else np.nan)

        with Parallel(n_jobs=self.jobs, prefer="threads", require="sharedmem") as parallel:
            done: Any = parallel(delayed(column)(m, s) for m, s in models)
        return np.stack(list(done), axis=1)

    def _change(self, before: Sequence[np.ndarray], predicted: Sequence[np.ndarray], size: float) -> np.ndarray:
        """Return the whitened change (n,) per unit from the residuals `before` to those of `predicted`, `size` units away."""
        each = zip(self.trials, predicted, before, strict=True)
        return self.white([self.prepared.measured[k] - y - r for k, y, r in each]) / size

    def _coarsely(self, at: Evaluation) -> list[np.ndarray] | None:
        """Return the residuals by the long steps that derivatives of motion are computed with, `at.raw` being by short ones.

        None where long steps do not give the derivatives, and where this motion is lost in them.
        """
        if not self._differences_at(at).long_steps:
            return None
        with suppress(SolveError):
            return self._raw(self.predict(at.model.twin, once=True)[1])
        return None

    def _differences_at(self, at: Evaluation, again: bool = False) -> Differences:
        """Return how derivatives of this motion are computed, as tried once with the effects in force, or `again`.

        Motion that is smooth without an effect may stick with it, and in less than a long step's way.
        """
        effects = frozenset(e.id for e in at.model.twin.effects if e.acts_on_robot)
        if again or effects not in self._differences:
            self._differences[effects] = self._choose_differences(at)
        return self._differences[effects]

    def _choose_differences(self, at: Evaluation) -> Differences:
        """Return which steps and which difference give the derivative along a move of all free parameters.

        Long steps serve where short ones give nearly the same. Of the two differences that serves which changes the derivative
        less when it is halved: a large one errs by what bends, a small one by what jumps.
        """
        x, before, serve = at.model.vector(), at.raw, False

        def change(size: float, raw: list[np.ndarray], long_steps: bool) -> np.ndarray:
            return self._change(raw, self.predict(at.model.at(x + size).twin, once=long_steps)[1], size)

        def halved(size: float) -> float:
            return float(np.linalg.norm(change(size, before, serve) - change(0.5 * size, before, serve)))

        with suppress(SolveError):
            fine, raw = change(MOTION_DIFFERENCE, before, False), self._raw(self.predict(at.model.twin, once=True)[1])
            if np.linalg.norm(change(MOTION_DIFFERENCE, raw, True) - fine) <= self._coarse_error * np.linalg.norm(fine):
                before, serve = raw, True
        with suppress(SolveError):
            if halved(PARAMETER_DIFFERENCE) < halved(MOTION_DIFFERENCE):
                return Differences(serve, PARAMETER_DIFFERENCE)
        return Differences(serve, MOTION_DIFFERENCE)

    def _raw(self, predicted: Sequence[np.ndarray]) -> list[np.ndarray]:
        return [self.prepared.measured[k] - y for k, y in zip(self.trials, predicted, strict=True)]

    def jacobian(self, at: Evaluation, which: Sequence[int]) -> np.ndarray:
        """Return dz/dx (n, len(which)) for the listed free parameters, x in steps.

        Where motion is lost on one side, by the difference to the other; a parameter that may not move to either has zeros.
        """
        x, difference = at.model.vector(), PARAMETER_DIFFERENCE
        if self.bends and len(which):
            difference = self._differences_at(at, any(at.model.free[i].effect is None for i in which)).size
        ranges = [(p.low / p.step, p.high / p.step) for p in (at.model.free[i].parameter for i in which)]
        sizes = [difference if x[i] + difference <= high else -difference for i, (_, high) in zip(which, ranges, strict=True)]

        def neighbour(i: int, size: float) -> tuple[Model, float]:
            return at.model.at(x + size * (np.arange(x.size) == i)), size

        unsolved: Unsolved = "nan" if self.bends else "raise"
        J = self.columns(at, [neighbour(i, s) for i, s in zip(which, sizes, strict=True)], once=True, unsolved=unsolved)
        for k, (i, size, (low, high)) in enumerate(zip(which, sizes, ranges, strict=True)):
            if np.isnan(J[:, k]).all():
                back = [neighbour(i, -size)] if low <= x[i] - size <= high else []
                J[:, k] = self.columns(at, back, once=True, unsolved="zeros").sum(axis=1)
        return J

    def renewed(self, at: Evaluation, which: Sequence[int], known: np.ndarray) -> np.ndarray:
        """Return dz/dx (n, len(which)) as `jacobian`, with columns of `known`, of the same shape, where these hardly changed.

        That is seen on the `TRIALS_PROBED` trials with the largest residuals, whose rows are renewed in every column.
        """
        ends, wanted, out = np.cumsum([0, *(r.size for r in at.raw)]), np.asarray(which, int), known.copy()
        order = np.argsort([-float(at.z[a:b] @ at.z[a:b]) for a, b in pairwise(ends)])
        changed = np.arange(wanted.size)
        for part in (np.sort(order[:TRIALS_PROBED]), np.sort(order[TRIALS_PROBED:])):
            if not (part.size and changed.size):
                break
            rows = np.concatenate([np.arange(int(ends[k]), int(ends[k + 1])) for k in part])
            trials = [self.trials[k] for k in part]
            there = Evaluation(at.model, {k: at.traces[k] for k in trials}, [at.raw[k] for k in part], at.z[rows])
            few = self.of(part.tolist())
            few._differences = self._differences
            found = few.jacobian(there, wanted[changed].tolist())
            before = out[np.ix_(rows, changed)]
            out[np.ix_(rows, changed)] = found
            changed = changed[np.linalg.norm(found - before, axis=0) > CHANGED_SHARE * np.linalg.norm(found, axis=0)]
        return out


def _same_simulation(a: Twin, b: Twin) -> bool:
    """Return whether two twins differ only in what sensors report, so that one simulation serves both."""

    def acting(t: Twin) -> list[Effect]:
        return [e for e in t.effects if e.acts_on_robot]

    return a.values == b.values and acting(a) == acting(b)
