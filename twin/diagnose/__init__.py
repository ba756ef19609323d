"""Which effect, or none, explains what calibration leaves.

diagnosis.py   the types that travel to the report
spikes.py      marker samples that stand alone
split.py       trials no fit may see
objective.py   what every fit minimises: residuals made white
null.py        what noise alone would show on this design
evidence.py    named effects against "some smooth error"
identifiability.py  what these data cannot tell
screen.py      which effects are worth a refit
search.py      beam search over sets of effects
rigs.py        whether the trials come from one robot
describe.py    what is left, in words
held_out.py    the error on unseen trials
verdict.py     gates, the verdict, and its numbers
experiment.py  the trial that would settle a doubt
"""

from twin.diagnose.diagnosis import Claim, Diagnosis, Errors, Settings
from twin.diagnose.verdict import calibration, diagnose

__all__ = ["Claim", "Diagnosis", "Errors", "Settings", "calibration", "diagnose"]
