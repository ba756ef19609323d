"""A backbone as a chain of hinges pulled by tendons: equilibria and motion.

equilibrium.py     the compiled chain and its static solve       dynamics.py       motion, between MuJoCo's steps
tension_trials.py  a trial under given tensions                  held_trials.py    tendons held at lengths or by SMA springs
antagonists.py     a jaw between two tendons                     held_tendons.py   held tendons in motion
trial_steps.py     steps shared by all static trials             continuation.py   moves between equilibria, and tip searches
tension_along.py   tension along a tendon                        drawing.py        the chain as it is drawn
balance/           force balance, its tangent, Newton's method
"""

from twin.mechanics.rod.equilibrium import ChainSolution, Equilibrium

__all__ = ["ChainSolution", "Equilibrium"]
