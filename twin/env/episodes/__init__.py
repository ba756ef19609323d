"""What the environments share.

base.py                  episodes, copies, pickles, saved states
domain_randomisation.py  twins drawn from the uncertainty of a diagnosis
observation.py           parts of an observation and their bounds
validation.py            options, actions and own goals, checked
rendering.py             frames by MuJoCo's renderer
"""
