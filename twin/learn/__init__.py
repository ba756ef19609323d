"""What is learned from data where the physics ends; always beside the physical attribution, never in it.

remainder.py  a small regularised map from pulls to what the twin leaves
"""

from twin.learn.remainder import Remainder

__all__ = ["Remainder"]
