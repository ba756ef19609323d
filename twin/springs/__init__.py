"""Shape-memory alloy springs that pull tendons: each law alone, as the static solve uses it.

spring.py   the numbers of the springs       force.py   elongation, temperature and history -> tension
heat.py     current -> temperature           alone.py   many springs along given elongations, without a robot

superelastic.py   a spring of another kind, that no current drives: elongation -> tension, with coils that narrow
"""

from __future__ import annotations

from twin.springs.alone import pull
from twin.springs.spring import Spring, springs_of

__all__ = ["Spring", "pull", "springs_of"]
