"""Train a policy on demonstrations (torch), beside which its weights and a card are stored.

Every epoch has a random stream of its own, so that a resumed training needs only the last checkpoint. All demonstrations are
trained on; the learning rate falls by a cosine to zero, and the last weights are the policy.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError, TwinError, UnknownNameError
from twin.tasks.imitation import lerobot
from twin.tasks.imitation.demonstrate import write_json
from twin.tasks.imitation.representations import representation_class

if TYPE_CHECKING:
    from twin.tasks.imitation.policy import PolicyNetwork

POLICY_FORMAT = "twin-policy/1"
LEARNED_POLICIES = ("diffusion", "cloning")
DEFAULT_EPOCHS = 120
EPOCHS_PER_CHECKPOINT = 20
BATCH_SIZE, LEARNING_RATE, WEIGHT_DECAY = 256, 1e-3, 1e-4
OBSERVATION_NOISE = 0.05  # of the largest observation: standard deviation of the noise added at each use


@dataclass(frozen=True)
class PolicyTrainingSpec:
    """Settings that, with the demonstrations and the code, determine every weight."""

    policy: str
    way: str
    seed: int
    epochs: int = DEFAULT_EPOCHS

    def path(self, folder: Path) -> Path:
        """Return the weights' file of this spec."""
        return folder / "policies" / f"{self.policy}-{self.way}-{self.seed}.pt"


def train_or_load(spec: PolicyTrainingSpec, folder: Path, progress: Callable[[str], None] = lambda words: None) -> PolicyNetwork:
    """Return the policy of this spec on the demonstrations in `folder`: loaded, or trained from its last checkpoint on.

    Raises UnknownNameError for an unknown policy or representation, TwinError without torch and diffusers, DataError for weights
    that cannot be read or are of other demonstrations.
    """
    if spec.policy not in LEARNED_POLICIES:
        raise UnknownNameError("policy", spec.policy, ["nearest", *LEARNED_POLICIES])
    representation = representation_class(spec.way)
    for library in ("torch", "diffusers"):
        if importlib.util.find_spec(library) is None:
            raise TwinError(f"a learned policy needs {library}, which is not installed; pip install 'tendon-twin[imitation]'")
    import torch

    from twin.tasks.imitation.policy import POLICIES

    torch.set_num_threads(1)
    demonstrations = [
        representation.from_demonstration(episode) for episode in lerobot.read_episodes(folder, representation.columns)
    ]
    made_of = asdict(spec) | {"format": POLICY_FORMAT, "data": hash_demonstrations(demonstrations)}
    path = spec.path(folder)
    torch.manual_seed(spec.seed)
    policy = POLICIES[spec.policy](demonstrations[0].shape[1])
    if path.exists():
        policy.load_state_dict(_read_checkpoint(path, made_of)["policy"])
        return policy.eval()
    path.parent.mkdir(exist_ok=True)
    checkpoint = path.with_name(path.name + ".checkpoint")
    losses = _train(policy, demonstrations, spec, checkpoint, made_of, progress)
    _write_checkpoint(path, {"made_of": made_of, "policy": policy.state_dict()})
    versions = {name: importlib.metadata.version(name) for name in ("torch", "diffusers", "numpy")}
    command = f"twin imitate {folder} --policy {spec.policy} --way {spec.way} --train-seed {spec.seed}"
    write_json(path.with_suffix(".json"), made_of | {"versions": versions, "command": command, "loss": losses})
    checkpoint.unlink(missing_ok=True)
    return policy.eval()


def hash_demonstrations(demonstrations: Sequence[np.ndarray]) -> str:
    """Return the SHA-256 of the demonstrations."""
    total = hashlib.sha256()
    for x in demonstrations:
        total.update(np.ascontiguousarray(x).tobytes())
    return total.hexdigest()


def _train(
    policy: PolicyNetwork, demonstrations: Sequence[np.ndarray], spec: PolicyTrainingSpec, checkpoint: Path,
    made_of: dict[str, Any], progress: Callable[[str], None],
) -> list[float]:  # fmt: skip
    """Train and return the mean loss of every epoch."""
    import torch

    policy.fit_scaling(demonstrations)
    o, a = policy.training_pairs(demonstrations)
    optimizer = torch.optim.AdamW(policy.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    losses: list[float] = []
    if checkpoint.exists():
        checkpointed = _read_checkpoint(checkpoint, made_of)
        policy.load_state_dict(checkpointed["policy"])
        optimizer.load_state_dict(checkpointed["optimizer"])
        losses = checkpointed["losses"]
    steps = math.ceil(len(o) / BATCH_SIZE)
    while (epoch := len(losses)) < spec.epochs:
        rng = torch.Generator().manual_seed(1_000_003 * spec.seed + epoch)
        total = 0.0
        for b, pick in enumerate(torch.randperm(len(o), generator=rng).chunk(steps)):
            optimizer.param_groups[0]["lr"] = 0.5 * LEARNING_RATE * (1.0 + math.cos(math.pi * (epoch + b / steps) / spec.epochs))
            disturbed = o[pick] + OBSERVATION_NOISE * torch.randn(len(pick), o.shape[1], generator=rng)
            loss = policy.loss(disturbed, a[pick], rng)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += loss.item()
        losses.append(total / steps)
        if len(losses) % EPOCHS_PER_CHECKPOINT == 0:
            state = {"policy": policy.state_dict(), "optimizer": optimizer.state_dict(), "losses": losses}
            _write_checkpoint(checkpoint, {"made_of": made_of} | state)
            progress(f"taught {len(losses)} of {spec.epochs} epochs, loss {losses[-1]:.4f}")
    return losses


def _read_checkpoint(path: Path, made_of: dict[str, Any]) -> dict[str, Any]:
    """Read weights or a checkpoint. Raises DataError for a broken file or one of other demonstrations."""
    import torch

    try:
        content = torch.load(path, weights_only=True)
        same = content["made_of"] == made_of
    except Exception as fault:  # torch raises of many kinds for a broken file
        raise DataError(f"{path}: no policy of this program ({type(fault).__name__}); delete it, it is made again") from None
    if not same:
        raise DataError(f"{path} was taught otherwise, or other demonstrations; delete it, it is made again")
    return content


def _write_checkpoint(path: Path, content: dict[str, Any]) -> None:
    """Write weights or a checkpoint, whole or not at all."""
    import torch

    write_atomically(path, lambda file: torch.save(content, file))
