"""Which effect, or none, explains what calibration leaves.

split.py       trials no fit may see
evidence.py    named effects against "some smooth error"
identifiability.py  what these data cannot tell
screen.py      which effects are worth a refit
search.py      beam search over sets of effects
verdict.py     gates, the verdict, and its numbers
experiment.py  the trial that would settle a doubt
"""

from twin.diagnose.verdict import Claim, Diagnosis, Errors, Settings, calibration, diagnose

__all__ = ["Claim", "Diagnosis", "Errors", "Settings", "calibration", "diagnose"]
