"""Predictions of a twin under given or drawn controls, as recordings that can be diagnosed again.

controls.py   controls from a table, a measurement set's inputs, or a seed
rollout.py    the rollouts, in parallel
"""

from twin.prediction.rollout.controls import Drawing, commands, controls_from_set, controls_from_table, draw_controls, full_pull
from twin.prediction.rollout.rollout import LostRollout, Rollouts, can_step_controls, rollout

__all__ = [
    "Drawing",
    "LostRollout",
    "Rollouts",
    "can_step_controls",
    "commands",
    "controls_from_set",
    "controls_from_table",
    "draw_controls",
    "full_pull",
    "rollout",
]
