"""What is learned from data where the physics ends, always beside the physical attribution, never in it; and from being shown.

remainder.py    a small regularised map from pulls to what the twin leaves
hands.py        built hands, and the shape of all their fingers     demonstrate.py  tasks shown by a person's hand
lerobot.py      their files                                         ways.py         by shape, by strain, by bend
policy.py       what a network wants: diffusion, cloning            teach.py        how it is taught
drifting.py     sensors that drift over a day of trials             imitate.py      what was shown, done by tendons
kept.py         trials kept to be looked at again
"""

from twin.learn.remainder import Remainder

__all__ = ["Remainder"]
