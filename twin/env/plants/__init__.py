"""Robots stepped in time under commands, with their effects.

rod_plant.py  a backbone                          soft_plant.py  a silicone finger, a hand among things effect_io.py  effects on
commands and signals over an episode
"""
