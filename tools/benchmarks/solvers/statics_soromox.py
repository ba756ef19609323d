"""SoRoMoX's side of statics.py: reads tensions (n, 3) as JSON, then for each further line prints the seconds of a warm solve.

Runs in an environment of its own: pip install soromox==0.5.0 optimistix
"""

from __future__ import annotations

import json
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp  # noqa: E402
import optimistix  # noqa: E402
from soromox.actuation import ThreadlikeActuator, ThreadlikeRouting  # noqa: E402
from soromox.systems import GVS  # noqa: E402
from soromox.systems.components import JointSpec, LinkSpec  # noqa: E402
from soromox.systems.gvs import GVSSegment, StrainBasisSpec  # noqa: E402

ORDER = 4
DENSITY = 9.35e4  # kg/m^3, equivalent: disks and wire in the wire's volume (Peng Table 2)


def robot() -> GVS:
    link = LinkSpec.circular(
        length=0.12,
        density=DENSITY,
        radius=4e-4,
        young_modulus=77.59e9,
        poisson_ratio=0.33,
        material_damping_coefficient=1e6,
        reference_strain=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    )
    basis = StrainBasisSpec(type="legendre", strain_selector=[0, 1, 1, 0, 0, 0], basis_order=ORDER)
    angle = jnp.deg2rad(jnp.array([0.0, 120.0, 240.0]))
    holes = 8e-3 * jnp.stack((jnp.zeros_like(angle), jnp.cos(angle), jnp.sin(angle)), -1)
    routing = ThreadlikeRouting.linear(intercept=holes, slope=0.0 * holes, start_segment_index=0, end_segment_index=0)
    return GVS.from_segments(
        [GVSSegment(link=link, joint=JointSpec.fixed(), basis=basis, num_gauss_points=8)],
        gravity=jnp.array([0.0, 0.0, 9.81]),
        base_pose=jnp.array([jnp.sqrt(0.5), 0.0, jnp.sqrt(0.5), 0.0, 0.0, 0.0, 0.0]),
        actuators=ThreadlikeActuator.tendons(routing),
        scale_rotational_basis_by_length=True,
    )


def main() -> None:
    tensions = jnp.array(json.loads(sys.stdin.readline()))
    body = robot()
    newton = optimistix.Newton(rtol=1e-8, atol=1e-10)

    def residual(q, u):
        return body.stiffness_matrix() @ q + body.gravitational_force(q) - body.actuation_matrix(q) @ u

    solve = jax.jit(lambda u, q: optimistix.root_find(residual, newton, q, u, max_steps=100, throw=False).value)
    size = int(jnp.sum(jnp.asarray(body.dofs_per_segment)))
    q = solve(tensions[0], jnp.zeros(size)).block_until_ready()
    print("ready", flush=True)
    for _ in sys.stdin:
        q = solve(tensions[0], jnp.zeros(size))
        times = []
        for u in tensions:
            began = time.perf_counter()
            q = solve(u, q).block_until_ready()
            times.append(time.perf_counter() - began)
        print(sorted(times)[len(times) // 2], flush=True)


if __name__ == "__main__":
    main()
