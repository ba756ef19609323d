"""Stage `look`: the robot as described held against the data, and what they may mean otherwise, before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twin.bench import Bench
from twin.diagnose.diagnosis import Settings
from twin.diagnose.loops import Loops, loops
from twin.diagnose.split import blind, split
from twin.diagnose.study import Progress, silent
from twin.diagnose.suspicions import Suspicion, suspicions
from twin.diagnose.suspicions.case import beginnings
from twin.diagnose.thresholds import FEW
from twin.errors import SolveError
from twin.twin import Twin, readings, report, simulate, unstable_starts


@dataclass(frozen=True)
class Looked:
    """The bench with notices of unstable starts, the sealed trials (none of fewer than `FEW`), the prediction (n_k, n_output) of
    the twin as described, the suspicions, and the loops of pulling and releasing in the trials that are not sealed."""

    bench: Bench
    sealed: tuple[int, ...]
    nominal: tuple[np.ndarray, ...]
    suspicions: tuple[Suspicion, ...]
    loops: Loops


def looked_at(bench: Bench, twin: Twin, settings: Settings, progress: Progress = silent) -> Looked:
    """What is known before the first fit. Raises SolveError, with what may be wrong, where the twin as described has no
    equilibrium."""
    sealed = split(bench, settings.seed)[1] if len(bench.inputs) >= FEW else []
    progress("nominal prediction")
    try:
        simulate(twin, beginnings(bench))
        traces = simulate(twin, bench)
    except SolveError as error:
        found = suspicions(bench, twin, sealed, None)
        raise SolveError("\n".join([str(error), *(f"Suspicion: {s.words}. Change: {s.change}." for s in found)])) from None
    nominal = tuple(readings(bench, report(twin.effects, t.true)) for t in traces)
    unstable = tuple(f"{name}: unstable start, its shape is one of several" for name in unstable_starts(bench, traces))
    progress("what the files may mean otherwise")
    found = suspicions(bench, twin, sealed, nominal)
    return Looked(replace(bench, notices=(*bench.notices, *unstable)), tuple(sealed), nominal, found, loops(blind(bench, sealed)))
