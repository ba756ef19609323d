"""Motion that statics lacks, of the robot as calibrated or of the twin that was found."""

from dataclasses import replace

from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext
from twin.prediction.motion import with_swing
from twin.prediction.prepared import PreparedRecording


def fast_motion(context: FitContext, found: ScoredModel, prepared: PreparedRecording) -> PreparedRecording | None:
    """Return the recording `prepared`, its fast motion that of a model found in it, to be calibrated again.

    None where the motion does not show in the noise that was estimated, or where that of this model is no nearer to the fitted
    trials than what was found.
    """
    twin, traces = found.fit.model.twin, found.fit.evaluation.traces
    shown = [traces[k].outputs(twin, context.prepared) if k in traces else y for k, y in enumerate(context.prepared.measured)]
    moving = with_swing(context.prepared, twin, shown, context.trials, context.objective.whitener.noise.sigma)
    return None if moving is None else replace(prepared, inputs=moving[0].inputs)
