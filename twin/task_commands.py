"""Commands of tasks on a hand: `twin tasks`, `demonstrate`, `imitate`."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.table import Table
from tyro.conf import Positional, arg

from twin.errors import DataError
from twin.terminal import cores, out, working

if TYPE_CHECKING:
    from twin.tasks import Outcome

HAND = "hand"


@dataclass(frozen=True)
class Tasks:
    """List the tasks a hand can be shown, and what counts as success."""

    def run(self) -> None:
        from twin.tasks import tasks

        table = Table("task", "what it is", "success", "takes, s")
        for name, law in tasks().items():
            table.add_row(name, law.about, law.success, f"{law.seconds:g}")
        out.print(table)


@dataclass(frozen=True)
class Demonstrate:
    """Show a hand a task: a person's pushes on fingers whose tendons are slack, recorded as a bench would record them.

    Keeps the attempts that succeed, in the layout of LeRobot's datasets; the same whatever the number of jobs; run again to go on
    after a stop.
    """

    task: Positional[Annotated[str, arg(help="which task; a wrong name lists those there are")]]
    n: Annotated[int, arg(help="how many demonstrations")]
    out: Annotated[Path, arg(help="folder for them")]
    seed: Annotated[int, arg(help="builds the hand and draws everything")] = 0
    jobs: Annotated[int, arg(help="worker threads")] = cores()

    def run(self) -> None:
        from twin.learn.demonstrate import Order, demonstrate
        from twin.learn.kept import SHOWN
        from twin.robots import load
        from twin.tasks import task

        if self.n < 1 or self.seed < 0 or self.jobs < 1:
            raise DataError(f"--n {self.n} --seed {self.seed} --jobs {self.jobs}: n and jobs from 1 on, seed from 0 on are needed")
        order = Order(task(self.task), load(HAND), self.n, self.seed)
        out.print(f"{self.task}: success is that {order.task.success}", highlight=False, markup=False)
        with working(f"showing {self.task}") as progress:
            outcomes = demonstrate(order, self.out, self.jobs, progress)
        command = f"twin demonstrate {self.task} --n {self.n} --seed {self.seed} --out {self.out}"
        provenance(self.out, SHOWN, command, self.seed)
        out.print(f"demonstrations: {self.out}; attempts: {counts(outcomes)}", highlight=False, markup=False)
        out.print(f"to look at them: twin view {self.out}", highlight=False, markup=False)


@dataclass(frozen=True)
class Imitate:
    """Do by tendons what was shown by hand, and count what becomes of fresh trials.

    A policy says what is wanted next, of shapes or of raw strains; control by shape, or strain tracking, follows. It is learned
    first where DATA/policies does not hold it yet; a stop in between loses little.
    """

    data: Positional[Annotated[Path, arg(help="folder that twin demonstrate made")]]
    policy: Annotated[str, arg(help="diffusion or cloning (extra imitation), or nearest: the nearest frame")] = "diffusion"
    way: Annotated[str, arg(help="shape, strain, or bend: what opposite cords differ by")] = "shape"
    train_seed: Annotated[int, arg(help="draws the training; nearest has none")] = 0
    hand: Annotated[int | None, arg(help="seed of the hand that acts; default: the one that was shown")] = None
    drift: Annotated[float, arg(help="share by which cords drift at most, from the first trial to the last; 0.083 was seen")] = 0.0
    checked: Annotated[bool, arg(help="free motion before each trial tells the drift, which is undone")] = False
    trials: Annotated[int, arg(help="how many")] = 20
    seed: Annotated[int, arg(help="draws the trials")] = 0
    jobs: Annotated[int, arg(help="worker threads")] = cores()

    def run(self) -> None:
        from twin.learn.demonstrate import read
        from twin.learn.imitate import Actor, learn
        from twin.learn.kept import Kept, Told, file_of, keep
        from twin.learn.teach import Lesson
        from twin.robots import load
        from twin.tasks import Trial, task

        if self.trials < 1 or min(self.seed, self.train_seed, self.hand or 0) < 0 or self.jobs < 1:
            raise DataError("--trials and --jobs from 1 on, --seed, --train-seed and --hand from 0 on are needed")
        if not 0.0 <= self.drift < 1.0:
            raise DataError(f"--drift {self.drift:g}: a share from 0 to below 1 is needed")
        order = read(self.data)
        lesson, what = Lesson(self.policy, self.way, self.train_seed), task(order["task"])
        hand = order["seed"] if self.hand is None else self.hand
        name = self._name(hand)

        def kept(number: int, trial: Trial) -> None:
            keep(file_of(self.data, name, number), Kept.of(trial, Told(what.name(), HAND, hand, name, number)))

        out.print(f"{what.name()}: success is that {what.success}", highlight=False, markup=False)
        with working(f"{what.name()} by {self.way}") as progress:
            policy = learn(lesson, self.data, progress)
            actor = Actor(what, load(HAND), hand, self.way, policy, self.drift, self.checked)
            found = actor.score(self.trials, self.seed, self.jobs, progress, kept)
        provenance(self.data, name, f"twin imitate {self.data}: {name}, {self.trials} trials", self.seed)
        whose = "the hand shown" if hand == order["seed"] else f"hand {hand}, shown on hand {order['seed']}"
        said = f"{what.name()} by {self.way} ({self.policy}), {whose}, seed {self.seed}: {counts(found)}"
        out.print(said, highlight=False, markup=False)
        out.print(f"to look at them: twin view {self.data / 'trials' / name}", highlight=False, markup=False)

    def _name(self, hand: int) -> str:
        """All that decides the trials, as a folder's name."""
        taught = self.policy if self.policy == "nearest" else f"{self.policy}-{self.train_seed}"
        drift = f"-drift{self.drift:g}of{self.trials}{'-checked' * self.checked}" if self.drift else ""
        return f"{taught}-{self.way}-hand{hand}-seed{self.seed}{drift}"


def provenance(folder: Path, name: str, command: str, seed: int) -> None:
    """What kept trials come from, beside them; the data is what was shown."""
    from twin.learn import lerobot
    from twin.learn.demonstrate import write_json
    from twin.learn.kept import file_of
    from twin.learn.teach import digest
    from twin.report import stamp

    shown = [episode["observation.state"] for episode in lerobot.read_episodes(folder, ("observation.state",))]
    write_json(file_of(folder, name, 0).with_name("provenance.json"), stamp(command, seed, digest(shown), ("pyarrow",)))


def counts(found: Counter[Outcome]) -> str:
    """`48 of 50 success; 2 slipped`."""
    from twin.tasks import Outcome

    rest = [f"{n} {what}" for what, n in found.items() if what is not Outcome.SUCCESS]
    return "; ".join([f"{found[Outcome.SUCCESS]} of {sum(found.values())} success", *rest])
