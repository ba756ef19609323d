"""`twin imitate`: perform a demonstrated task with the tendons."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.hand.records import HAND, count_outcomes, write_provenance
from twin.cli.terminal import cpu_count, out, show_progress
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class Imitate:
    """Perform a demonstrated task with the tendons, and count the outcomes of new trials.

    A policy gives the next target, a shape or raw strains; shape control or strain tracking follows it. The policy is trained first
    unless DATA/policies contains it; after a stop the training continues.
    """

    data: Positional[Annotated[Path, arg(help="folder made by twin demonstrate")]]
    policy: Annotated[str, arg(help="diffusion or cloning (extra imitation), or nearest: the nearest demonstrated frame")] = (
        "diffusion"
    )
    way: Annotated[str, arg(help="target of the policy: shape, strain, or bend, the difference of opposite cords")] = "shape"
    train_seed: Annotated[int, arg(help="seed of the training; not used by nearest")] = 0
    hand: Annotated[int | None, arg(help="seed of the hand that acts; default: the demonstrated hand")] = None
    drift: Annotated[
        float, arg(help="largest relative drift of the cords from the first trial to the last; real cords showed 0.083")
    ] = 0.0
    checked: Annotated[bool, arg(help="correct the drift by a free motion before each trial")] = False
    trials: Annotated[int, arg(help="number of trials")] = 20
    seed: Annotated[int, arg(help="seed of the trials")] = 0
    jobs: Annotated[int, arg(help="worker threads")] = cpu_count()

    def run(self) -> None:
        from twin.robots import load
        from twin.tasks import TaskTrial, make_task
        from twin.tasks.imitation.demonstrate import read_order
        from twin.tasks.imitation.episode_store import Episode, EpisodeInfo, episode_path, store_episode
        from twin.tasks.imitation.imitate import PolicyRunner, make_policy
        from twin.tasks.imitation.policy_training import PolicyTrainingSpec

        if self.trials < 1 or min(self.seed, self.train_seed, self.hand or 0) < 0 or self.jobs < 1:
            raise DataError("--trials and --jobs must be 1 or more, --seed, --train-seed and --hand 0 or more")
        if not 0.0 <= self.drift < 1.0:
            raise DataError(f"--drift {self.drift:g}: the drift must be from 0 to below 1")
        order = read_order(self.data)
        lesson, what = PolicyTrainingSpec(self.policy, self.way, self.train_seed), make_task(order["task"])
        hand = order["seed"] if self.hand is None else self.hand
        name = self._folder_name(hand)

        def store(number: int, trial: TaskTrial) -> None:
            store_episode(
                episode_path(self.data, name, number), Episode.of(trial, EpisodeInfo(what.name(), HAND, hand, name, number))
            )

        out.print(f"{what.name()}: success is that {what.success_criterion}", highlight=False, markup=False)
        with show_progress(f"{what.name()} by {self.way}") as progress:
            policy = make_policy(lesson, self.data, progress)
            actor = PolicyRunner(what, load(HAND), hand, self.way, policy, self.drift, self.checked)
            found = actor.score(self.trials, self.seed, self.jobs, progress, store)
        write_provenance(self.data, name, f"twin imitate {self.data}: {name}, {self.trials} trials", self.seed)
        whose = "the demonstrated hand" if hand == order["seed"] else f"hand {hand}, demonstrated on hand {order['seed']}"
        result = f"{what.name()} by {self.way} ({self.policy}), {whose}, seed {self.seed}: {count_outcomes(found)}"
        out.print(result, highlight=False, markup=False)
        out.print(f"to see them: twin view {self.data / 'trials' / name}", highlight=False, markup=False)

    def _folder_name(self, hand: int) -> str:
        """Return a name for the folder, with all settings that decide the trials."""
        policy = self.policy if self.policy == "nearest" else f"{self.policy}-{self.train_seed}"
        drift = f"-drift{self.drift:g}of{self.trials}{'-checked' * self.checked}" if self.drift else ""
        return f"{policy}-{self.way}-hand{hand}-seed{self.seed}{drift}"
