"""Shape-memory alloy springs that pull tendons: heat balance and force law, as the robots' solvers use them.

force.py      elongation, temperature and history -> tension
heat.py       current -> temperature
response.py   temperature and tension of springs along given elongations, without a robot
"""

from twin.body.drives.spring import Spring, build_springs
from twin.mechanics.springs.response import spring_response

__all__ = ["Spring", "build_springs", "spring_response"]
