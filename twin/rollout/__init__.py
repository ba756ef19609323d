"""What a twin does under given or drawn controls, as recordings that can be diagnosed again.

controls.py   where controls come from: a table, a measurement set's inputs, or a seed
rollout.py    the runs, side by side
"""

from twin.rollout.controls import Drawing, drawn, from_set, from_table, full_pull
from twin.rollout.rollout import Ended, Rollouts, is_dynamic, rollout

__all__ = ["Drawing", "Ended", "Rollouts", "drawn", "from_set", "from_table", "full_pull", "is_dynamic", "rollout"]
