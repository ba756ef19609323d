"""Which effects on which day: blocks of thirty, of which any beginning may be made.

Four days have no effect, sixteen one, five two, five something no catalogue knows. Known kinds are dealt
from a shuffled pack, to its end before any comes again: a block takes 26, so all 23 come up in it. Ten days of a block are
driven by displacements where as many can be: some effects show only there, others only with tensions.
"""

from dataclasses import dataclass

import numpy as np

from tools.simulators.second_rod.day import Drive
from tools.simulators.second_rod.effects import CATALOGUE_KINDS, EFFECT_KINDS, ODD_KINDS

DAYS_PER_PLAN, DAYS_WITHOUT, DAYS_WITH_ONE, DAYS_WITH_PAIR, DAYS_WITH_ODD = 30, 4, 16, 5, 5
BY_DISPLACEMENT = 10
OTHERS_LOGGED = 1 / 3  # share of days whose other tendon quantity is logged too
SMALLEST_SIZE, LARGEST_SIZE = 1.0, 8.0  # marker noises; half the effects are spread over this in equal ratios
USUAL = (2.5, 3.5)  # the other half
# two of one group in one day would be much the same thing twice, or hide each other
SIMILAR_KINDS = (
    {"delay", "lag", "saturation"}, {"gain", "bias", "drift", "crosstalk"}, {"asymmetry", "gradient"}, {"tilt", "payload"},
    {"wall", "post"}, {"backlash", "elasticity", "drum"}, {"temperature", "ageing", "creep"}, {"tilt", "camera", "precurvature"},
    {"routing", "asymmetry"},
)  # fmt: skip


@dataclass(frozen=True)
class Planned:
    """One day: kinds of effects by the names of their draws, each with the size asked for in marker noises."""

    number: int  # from 1
    drive: Drive
    kinds: tuple[str, ...]
    targets: tuple[float, ...]
    logs_others: bool


class Pack:
    """Names dealt one at a time, all of them before any comes again."""

    def __init__(self, names: list[str], random: np.random.Generator) -> None:
        self.names, self.random = names, random
        self.left: list[str] = []

    def deal(self, beside: str | None = None) -> str:
        """The next name; beside another, the next that can be with it on one day."""
        fits = [n for n, name in enumerate(self.left) if beside is None or may_pair(beside, name)]
        if not fits:
            fresh = list(self.names)
            self.random.shuffle(fresh)
            self.left += fresh
            return self.deal(beside)
        return self.left.pop(fits[0])


def may_pair(one: str, other: str) -> bool:
    together = one != other and not any({one, other} <= group for group in SIMILAR_KINDS)
    return together and bool(EFFECT_KINDS[one].drives & EFFECT_KINDS[other].drives)


def drives(kinds: tuple[str, ...]) -> frozenset[Drive]:
    """The drives on which all of these show."""
    both: frozenset[Drive] = frozenset({"tension", "displacement"})
    for kind in kinds:
        both &= EFFECT_KINDS[kind].drives
    return both


def spread(random: np.random.Generator, number: int) -> list[float]:
    """Sizes of so many effects, shuffled: half of them usual, the others in equal ratios from the smallest to the largest."""
    usual = number - number // 2
    steps = (np.arange(number - usual) + random.uniform(size=number - usual)) / max(number - usual, 1)
    sizes = np.concatenate([random.uniform(*USUAL, usual), SMALLEST_SIZE * (LARGEST_SIZE / SMALLEST_SIZE) ** steps])
    random.shuffle(sizes)
    return [float(size) for size in sizes]


def block(random: np.random.Generator, first: int) -> list[Planned]:
    """Thirty days, numbered from `first`."""
    known, odd = Pack(list(CATALOGUE_KINDS), random), Pack(list(ODD_KINDS), random)
    days: list[tuple[str, ...]] = [()] * DAYS_WITHOUT
    for _ in range(DAYS_WITH_PAIR):
        one = known.deal()
        days.append((one, known.deal(beside=one)))
    days += [(known.deal(),) for _ in range(DAYS_WITH_ONE)]
    days += [(odd.deal(),) for _ in range(DAYS_WITH_ODD)]
    days = [days[n] for n in random.permutation(DAYS_PER_PLAN)]
    able = [drives(kinds) for kinds in days]
    chosen = [n for n in range(DAYS_PER_PLAN) if able[n] == {"displacement"}]
    either = [n for n in range(DAYS_PER_PLAN) if len(able[n]) == 2]
    more = min(len(either), max(BY_DISPLACEMENT - len(chosen), 0))
    chosen += [int(n) for n in random.choice(either, more, replace=False)]
    # a delay between inputs and markers leaves open which of them a second tendon quantity goes with
    others = [n for n in range(DAYS_PER_PLAN) if "delay" not in days[n] and random.random() < OTHERS_LOGGED]
    sizes = spread(random, sum(len(kinds) for kinds in days))
    return [
        Planned(
            first + n,
            "displacement" if n in chosen else "tension",
            kinds,
            tuple(sizes.pop() for _ in kinds),
            n in others,
        )
        for n, kinds in enumerate(days)
    ]


def plan(days: int, seed: int) -> list[Planned]:
    """The first so many days of a seed; a longer plan begins as a shorter one does."""
    random = np.random.default_rng([seed, 0])
    out: list[Planned] = []
    while len(out) < days:
        out += block(random, len(out) + 1)
    return out[:days]
