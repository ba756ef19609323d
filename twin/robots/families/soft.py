"""Family "soft": a tapered silicone finger bent by tendons, with strain-sensing cords."""

from collections.abc import Mapping

import mujoco
import numpy as np

from twin.body import Drive, Sense, marker_senses, tendon_ports
from twin.body.strain_cords import Cords
from twin.foundation.parameters import parameter_array
from twin.mechanics.silicone import Cone, SoftBody, SoftDynamics, SoftStatics, straight_line
from twin.mechanics.silicone.drawing import SoftFigure
from twin.mechanics.silicone.material.lattice import lattice
from twin.robots.schemas.motor_rows import motor_ports, motor_senses
from twin.robots.schemas.soft import SOFT_SCHEMA as SCHEMA
from twin.robots.schemas.soft import Soft

__all__ = ["SCHEMA", "build", "chain", "dynamics", "figure", "hand", "silicone", "statics"]

SILICONE_COLOUR, TENDON_COLOUR, SENSOR_COLOUR, MARKER_COLOUR = (
    [0.93, 0.9, 0.82, 0.45],
    [0.85, 0.6, 0.15, 1.0],
    [0.15, 0.15, 0.18, 1.0],
    [0.9, 0.2, 0.2, 1.0],
)
SOFT_FEATURES = frozenset({
    "weight", "elasticity", "markers", "load cells", "drives that saturate", "strain sensors", "drifting sensors", "planes",
    "length", "hanging zero", "rest shape", "holes", "lines", "surface", "viscosity", "skin", "drive zeros", "slack",
})  # fmt: skip
N_DISCS = 24  # of the drawing


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> SoftBody:
    """Build the finger from `structure` and `values` (SI, by parameter name) that SCHEMA allows."""
    shape = Soft.model_validate(dict(structure))
    cone = Cone(values["body.length"], values["body.radius_base"], values["body.radius_tip"], values["body.clamp"])
    paths = _straight_paths(values, "tendons", shape.tendons, shape.tendon_points)
    cord_paths = _straight_paths(values, "sensors", shape.sensors, shape.sensor_points)
    seen = _skin_points(
        cone, parameter_array(values, "markers.azimuth", shape.markers), parameter_array(values, "markers.height", shape.markers)
    )
    markers = [f"marker_{m}" for m in range(1, shape.markers + 1)]
    cells = lattice(cone, shape.cells).quadrature[1]
    nt, ns = shape.tendons, shape.sensors
    wound = motor_ports(shape.motors or (), values, nt)
    return SoftBody(
        spec=_drawing_spec(cone, paths, cord_paths, seen),
        n_tendon=nt,
        features=SOFT_FEATURES,
        ports=tuple((*ports[:2], *wound.get(t, ())) for t, ports in enumerate(tendon_ports(nt))),
        dynamic_drives=frozenset({Drive.TENSION, Drive.DISPLACEMENT}),
        senses={
            **{f"tendon_{i}_{kind}": Sense(kind, i - 1) for i in range(1, nt + 1) for kind in ("tension", "displacement")},
            **{f"sensor_{i}_resistance": Sense("sensor", i - 1) for i in range(1, ns + 1)},
            **motor_senses(len(shape.motors or ()), values),
            **marker_senses([*markers, "tip"]),
        },
        tendon_sites=tuple(tuple(f"tendon_{i}_{p}" for p in range(shape.tendon_points)) for i in range(1, nt + 1)),
        marker_sites=(*markers, "tip"),
        cone=cone,
        cells=shape.cells,
        paths=paths,
        anchor=values["tendons.anchor"],
        cord_paths=cord_paths,
        cords=Cords(
            *(np.array(parameter_array(values, f"sensors.{name}", ns)) for name in ("resistance", "stretch", "compression"))
        ),
        marker_rest=seen,
        turn=values["mounting.angle"],
        damping_time=values["silicone.damping"],
        youngs_modulus=values["silicone.youngs_modulus"],
        poisson=values["silicone.poisson_ratio"],
        density=values["silicone.density"],
        damping=values["silicone.damping"],
        shear=np.ones(cells.shape),
        bulk=np.ones(shape.cells),
        fibre=np.ones(cells.shape),
    )


def _straight_paths(values: Mapping[str, float], kind: str, n: int, points: int) -> np.ndarray:
    heights = values[f"{kind}.start"], values[f"{kind}.end"]
    radii = values[f"{kind}.radius_start"], values[f"{kind}.radius_end"]
    return np.stack([straight_line(azimuth, heights, radii, points) for azimuth in parameter_array(values, f"{kind}.azimuth", n)])


def _skin_points(cone: Cone, azimuth: np.ndarray, height: np.ndarray) -> np.ndarray:
    radius = cone.radius(height)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])


def _drawing_spec(cone: Cone, paths: np.ndarray, cord_paths: np.ndarray, seen: np.ndarray) -> mujoco.MjSpec:
    """Return the finger at rest: skin as discs, tendons and cords as lines, markers as spots."""
    spec = mujoco.MjSpec()
    world = spec.worldbody
    thick = 0.5 * cone.length / N_DISCS
    for z in (np.arange(N_DISCS) + 0.5) * cone.length / N_DISCS:
        world.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[float(cone.radius(z)), thick, 0], pos=[0, 0, z], rgba=SILICONE_COLOUR,
            contype=0, conaffinity=0,
        )  # fmt: skip
    for kind, lines, colour in (("tendon", paths, TENDON_COLOUR), ("sensor", cord_paths, SENSOR_COLOUR)):
        for i, points in enumerate(lines, 1):
            line = spec.add_tendon(name=f"{kind}_{i}", rgba=colour, width=5e-4)
            for p, point in enumerate(points):
                world.add_site(name=f"{kind}_{i}_{p}", pos=point, size=[3e-4, 0, 0], rgba=colour)
                line.wrap_site(f"{kind}_{i}_{p}")
    for m, point in enumerate(seen, 1):
        world.add_site(name=f"marker_{m}", pos=point, size=[1.2e-3, 0, 0], rgba=MARKER_COLOUR)
    world.add_site(name="tip", pos=[0, 0, cone.length], size=[1e-3, 0, 0])
    return spec


def silicone(body: SoftBody) -> SoftBody:
    return body


statics, dynamics, figure = SoftStatics, SoftDynamics, SoftFigure
chain = hand = None
