"""Training of a policy on demonstrations (torch), beside which it is kept: weights and a card that says what made them.

Every epoch draws from a stream of its own, so that what is left after a kill is the last checkpoint and nothing else. All that is
shown is taught; the rate falls by a cosine to nothing, and what is left then is the policy.
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

from twin.errors import DataError, TwinError, UnknownNameError
from twin.learn import lerobot
from twin.learn.demonstrate import write_json
from twin.learn.ways import way

if TYPE_CHECKING:
    from twin.learn.policy import Policy

FORMAT = "twin-policy/1"
KINDS = ("diffusion", "cloning")
EPOCHS = 120
KEEPS = 20  # epochs from checkpoint to checkpoint
BATCH, RATE, DECAY = 256, 1e-3, 1e-4
STIRRED = 0.05  # of the largest seen: by so much what is seen is disturbed whenever it is shown


@dataclass(frozen=True)
class Lesson:
    """What, with the demonstrations and the code, decides every weight."""

    policy: str
    way: str
    seed: int
    epochs: int = EPOCHS

    def path(self, folder: Path) -> Path:
        return folder / "policies" / f"{self.policy}-{self.way}-{self.seed}.pt"


def taught(lesson: Lesson, folder: Path, progress: Callable[[str], None] = lambda words: None) -> Policy:
    """The policy of this lesson on the demonstrations in `folder`: read where it is, trained where it is not, from its checkpoint
    on where there is one. Raises UnknownNameError for another policy or way, TwinError without torch and diffusers, DataError for
    weights that cannot be read or are of other demonstrations."""
    if lesson.policy not in KINDS:
        raise UnknownNameError("policy", lesson.policy, ["nearest", *KINDS])
    law = way(lesson.way)
    for library in ("torch", "diffusers"):
        if importlib.util.find_spec(library) is None:
            raise TwinError(f"a learned policy needs {library}, which is not installed; pip install 'tendon-twin[imitation]'")
    import torch

    from twin.learn.policy import POLICIES

    torch.set_num_threads(1)
    shown = [law.shown(episode) for episode in lerobot.read_episodes(folder, law.columns)]
    made_of = asdict(lesson) | {"format": FORMAT, "data": digest(shown)}
    path = lesson.path(folder)
    torch.manual_seed(lesson.seed)
    policy = POLICIES[lesson.policy](shown[0].shape[1])
    if path.exists():
        policy.load_state_dict(_read(path, made_of)["policy"])
        return policy.eval()
    path.parent.mkdir(exist_ok=True)
    checkpoint = path.with_name(path.name + ".checkpoint")
    losses = _train(policy, shown, lesson, checkpoint, made_of, progress)
    _write(path, {"made_of": made_of, "policy": policy.state_dict()})
    versions = {name: importlib.metadata.version(name) for name in ("torch", "diffusers", "numpy")}
    command = f"twin imitate {folder} --policy {lesson.policy} --way {lesson.way} --train-seed {lesson.seed}"
    write_json(path.with_suffix(".json"), made_of | {"versions": versions, "command": command, "loss": losses})
    checkpoint.unlink(missing_ok=True)
    return policy.eval()


def digest(shown: Sequence[np.ndarray]) -> str:
    """SHA-256 of what is shown."""
    total = hashlib.sha256()
    for x in shown:
        total.update(np.ascontiguousarray(x).tobytes())
    return total.hexdigest()


def _train(
    policy: Policy, shown: Sequence[np.ndarray], lesson: Lesson, checkpoint: Path, made_of: dict[str, Any],
    progress: Callable[[str], None],
) -> list[float]:  # fmt: skip
    """Mean loss of every epoch."""
    import torch

    policy.scale(shown)
    o, a = policy.pairs(shown)
    optimizer = torch.optim.AdamW(policy.parameters(), lr=RATE, weight_decay=DECAY)
    losses: list[float] = []
    if checkpoint.exists():
        found = _read(checkpoint, made_of)
        policy.load_state_dict(found["policy"])
        optimizer.load_state_dict(found["optimizer"])
        losses = found["losses"]
    steps = math.ceil(len(o) / BATCH)
    while (epoch := len(losses)) < lesson.epochs:
        rng = torch.Generator().manual_seed(1_000_003 * lesson.seed + epoch)
        total = 0.0
        for b, pick in enumerate(torch.randperm(len(o), generator=rng).chunk(steps)):
            optimizer.param_groups[0]["lr"] = 0.5 * RATE * (1.0 + math.cos(math.pi * (epoch + b / steps) / lesson.epochs))
            stirred = o[pick] + STIRRED * torch.randn(len(pick), o.shape[1], generator=rng)
            loss = policy.loss(stirred, a[pick], rng)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += loss.item()
        losses.append(total / steps)
        if len(losses) % KEEPS == 0:
            state = {"policy": policy.state_dict(), "optimizer": optimizer.state_dict(), "losses": losses}
            _write(checkpoint, {"made_of": made_of} | state)
            progress(f"taught {len(losses)} of {lesson.epochs} epochs, loss {losses[-1]:.4f}")
    return losses


def _read(path: Path, made_of: dict[str, Any]) -> dict[str, Any]:
    import torch

    try:
        found = torch.load(path, weights_only=True)
        same = found["made_of"] == made_of
    except Exception as fault:  # torch raises of many kinds for a broken file
        raise DataError(f"{path}: no policy of this program ({type(fault).__name__}); delete it, it is made again") from None
    if not same:
        raise DataError(f"{path} was taught otherwise, or other demonstrations; delete it, it is made again")
    return found


def _write(path: Path, content: dict[str, Any]) -> None:
    import torch

    part = path.with_name(path.name + ".part")
    torch.save(content, part)
    part.replace(path)
