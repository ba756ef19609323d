"""Silicone in motion.

stepping.py  bodies from step to step      contact.py  forces of tendons and contacts at a step's end
dynamics.py  a trial in motion             things.py   rigid things
scene.py     a hand among rigid things
"""
