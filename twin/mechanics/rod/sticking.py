"""What keeps MuJoCo's steps stable where a tendon sticks at a disk.

There it is a spring, K = T mu theta / presliding along its travel, that shakes light disks many times in a step h. Its force is
explicit, at MuJoCo's present shape; steps are stable by an inertia of each joint i, h^2 K |ds/dq_i| sum_j |ds/dq_j| at most, s the
length distal of the disk, while it sticks. MuJoCo has it as a damping that the same force at the joint's last rate makes up for
(`dynamics.step_through`), so that what moves steadily is not held back.
"""

import numpy as np

from twin.foundation.compiled import dot, jit_internal
from twin.mechanics.rod.balance.chain import point_velocity

STICKING_SHARE = 0.4  # of the inertia that makes a step implicit in what sticks: steps are stable from a quarter on


@jit_internal
def damp_sticking(system, state, motion, tendon, t, distal):
    """Add the damping (nv,) by which a step is stable where tendon t, traced, sticks; it slides at its farthest slip state."""
    chain, law, n = system.chain, system.law, tendon.T.size
    turns, damping = np.zeros(motion.own.size), STICKING_SHARE * motion.step * abs(state.T[t]) * law.mu / law.presliding
    for d in range(n):
        end = chain.site[chain.hole[t, d + 1]]
        for i in range(chain.first_joint[d], chain.first_joint[d + 1]):
            turns[i] = abs(dot(tendon.u[d], point_velocity(chain, i, end)))
    beyond, first = 0.0, chain.first_joint[n]
    for d in range(n - 1, 0, -1):
        while first > chain.first_joint[d]:
            first -= 1
            beyond += turns[first]
        z, travel = state.z[t, d], state.s[t, d] - distal[d]
        if abs(z) < 1.0 or z * travel < 0.0:
            for i in range(first, chain.first_joint[n]):
                motion.damping[i] += damping * tendon.theta[d] * turns[i] * beyond
