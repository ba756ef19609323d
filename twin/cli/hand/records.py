"""The origin and the outcomes of recorded trials."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from twin.tasks import Outcome

HAND = "hand"  # the robot of all tasks


def write_provenance(folder: Path, name: str, command: str, seed: int) -> None:
    """Write the origin of recorded trials beside them; the data hash is that of the demonstrations."""
    from twin.prediction.provenance import run_provenance
    from twin.tasks.imitation import lerobot
    from twin.tasks.imitation.demonstrate import write_json
    from twin.tasks.imitation.episode_store import episode_path
    from twin.tasks.imitation.policy_training import hash_demonstrations

    shown = [episode["observation.state"] for episode in lerobot.read_episodes(folder, ("observation.state",))]
    write_json(
        episode_path(folder, name, 0).with_name("provenance.json"),
        run_provenance(command, seed, hash_demonstrations(shown), ("pyarrow",)),
    )


def count_outcomes(found: Counter[Outcome]) -> str:
    """Return the counts in words, such as `48 of 50 success; 2 slipped`."""
    from twin.tasks import Outcome

    rest = [f"{n} {what}" for what, n in found.items() if what is not Outcome.SUCCESS]
    return "; ".join([f"{found[Outcome.SUCCESS]} of {sum(found.values())} success", *rest])
