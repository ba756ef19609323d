"""Training samples as a network sees them: held-out fingers apart, sensor errors drawn anew.

Every chain of samples is a finger of its own, with its own E; one chain in ten is held out. The readings are disturbed by the
errors that sensors and their alignment have, anew at each use of a sample.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from twin.foundation.errors import DataError
from twin.mechanics.silicone import SoftBody, SoftStatics
from twin.mechanics.silicone.single_equilibrium import SoftEquilibrium, hang_at_rest, nodal_weight
from twin.mechanics.silicone.skin import Skin
from twin.robots import Robot
from twin.robots.named_points import NamedPoints, named_points
from twin.shape.estimators.features import network_features
from twin.shape.training_data import shard
from twin.shape.training_data.draw import CHAIN_LENGTH

HELD_OUT_EVERY = 10  # one chain in so many is held out
# strain, relative, strain: errors of sensors and their alignment
STRAIN_NOISE_STD, GAIN_ERROR_STD, ZERO_ERROR_STD = 1.5e-4, 0.01, 2e-4
DISPLACEMENT_ERROR = 2e-5  # m, one standard deviation
DEAD_SENSOR_SHARE = 0.15  # of the samples have one sensor missing
SHOWN_AS_PUSHED_SHARE = 0.3  # of the free motions are shown as if something might press


@dataclass(frozen=True)
class TrainingSamples:
    """Converged samples, and the finger they are of.

    Samples: `strain` (n, s), `displacement` (n, t) m and `tension` (n, t) N of the tendons, displacements of the free nodes (n, 3
    n_free) m, `kind` (n,) of contact, `held_out` (n,), and `previous` (n,): the sample before in its chain, of the first itself.
    Finger: its points, their weights (P, n_free), its skin, and the strains (s,) of its hanging rest.
    """

    strain: np.ndarray
    displacement: np.ndarray
    tension: np.ndarray
    nodes: np.ndarray
    kind: np.ndarray
    held_out: np.ndarray
    points: NamedPoints
    point_weights: np.ndarray
    skin: Skin
    hanging_strain: np.ndarray
    previous: np.ndarray

    @property
    def pushed(self) -> np.ndarray:
        """Return whether a hand is on the finger, (n,)."""
        return self.kind != "free"


def load_samples(folder: Path, robot: Robot) -> TrainingSamples:
    """Load the shards in `folder`. Raises DataError where they cannot be read, are too few, or the robot is no finger."""
    body = robot.silicone(robot.build())
    points = named_points(robot)
    weights = body.lattice.weights(points.rest)
    d = shard.read_columns(folder, ["sample", "converged", "nodes", "strain", "command", "tension", "kind"])
    if d["nodes"].shape[1] != 3 * weights.shape[1]:
        raise DataError(f"{folder}: shapes of another body than robot {robot.name!r}; make them with twin generate")
    converged = d["converged"].astype(bool)
    held_out = (d["sample"] // CHAIN_LENGTH)[converged] % HELD_OUT_EVERY == HELD_OUT_EVERY - 1
    if not held_out.any():
        raise DataError(
            f"{folder}: fewer than {HELD_OUT_EVERY} fingers of {CHAIN_LENGTH} samples; none can be held out, ask for more samples"
        )
    nodes, kind = d["nodes"][converged].astype(np.float32), d["kind"][converged].astype(str)
    readings = d["strain"][converged], d["command"][converged], d["tension"][converged]
    sample, rows = d["sample"][converged], np.arange(len(held_out))
    follows = (np.diff(sample, prepend=-2) == 1) & (sample % CHAIN_LENGTH > 0)  # an unconverged sample breaks its chain
    previous = np.where(follows, rows - 1, rows)
    return TrainingSamples(*readings, nodes, kind, held_out, points, weights, Skin.of(body), _hanging_strain(robot, body), previous)


def _hanging_strain(robot: Robot, body: SoftBody) -> np.ndarray:
    """Return the strains (s,) of the hanging rest."""
    statics = SoftStatics(body)
    solid = SoftEquilibrium(statics.arrays)
    shape = solid.undeformed()
    hang_at_rest(solid, shape, nodal_weight(body, robot.gravity))
    return statics.sensor_signals(shape.u[None])["strain"][0]


def disturb(
    rng: np.random.Generator, samples: TrainingSamples, pick: np.ndarray, dead: float = DEAD_SENSOR_SHARE
) -> tuple[np.ndarray, np.ndarray]:
    """Return strains (b, s) and displacements (b, t) m of samples as sensors read them, some sensors missing."""
    strain = add_sensor_errors(rng, samples.strain[pick])
    strain = strain + STRAIN_NOISE_STD * rng.normal(size=strain.shape)
    return drop_sensors(rng, strain, dead), read_displacements(rng, samples, pick)


def add_sensor_errors(rng: np.random.Generator, strain: np.ndarray) -> np.ndarray:
    """Return strains (b, s) of sensors with errors of gain and zero."""
    return strain * (1.0 + GAIN_ERROR_STD * rng.normal(size=strain.shape)) + ZERO_ERROR_STD * rng.normal(size=strain.shape)


def drop_sensors(rng: np.random.Generator, strain: np.ndarray, share: float) -> np.ndarray:
    """Return strains (b, s) with one missing in a share of the rows; changed in place."""
    lost = rng.uniform(size=len(strain)) < share
    strain[lost, rng.integers(0, strain.shape[1], int(lost.sum()))] = np.nan
    return strain


def read_displacements(rng: np.random.Generator, samples: TrainingSamples, pick: np.ndarray) -> np.ndarray:
    """Return displacements (b, t) m of samples as motors read them."""
    return samples.displacement[pick] + DISPLACEMENT_ERROR * rng.normal(size=samples.displacement[pick].shape)


def training_features(rng: np.random.Generator, samples: TrainingSamples, pick: np.ndarray) -> np.ndarray:
    """Return features (b, f) of samples to train on, in single precision."""
    pressed = samples.pushed[pick] | (rng.uniform(size=len(pick)) < SHOWN_AS_PUSHED_SHARE)
    return network_features(*disturb(rng, samples, pick), pressed).astype(np.float32)
