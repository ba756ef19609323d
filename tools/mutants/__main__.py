"""See the package's docstring."""

import argparse
import json
import tomllib
from collections import Counter
from collections.abc import Callable
from fnmatch import fnmatchcase
from pathlib import Path
from random import Random

from tools.mutants.attempt import Tree
from tools.mutants.by_hand import by_hand
from tools.mutants.groups import GROUPS, group_of
from tools.mutants.mutant import Mutant
from tools.mutants.operators import mutants

MUTANTS_FOLDER = Path(__file__).parent
OUTCOMES, REASONS = MUTANTS_FOLDER / "outcomes.json", MUTANTS_FOLDER / "reasons.toml"
OUTCOME_KINDS = ("killed", "timed out", "survived")
COLUMNS_SHOWN = (*OUTCOME_KINDS, "with a reason")
NEW = "survived"  # or never tried


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.mutants", description="One line changed: do the tests see it?")
    parser.add_argument("what", choices=["run", "again", "table"], help="again: what survived without a reason")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--each", type=int, default=25, help="mutants sampled of each group")
    parser.add_argument("--only", nargs="+", choices=sorted(GROUPS), help="groups")
    parser.add_argument("--patience", type=float, default=300.0, help="s, for the tests of one mutant")
    args = parser.parse_args()
    if args.what != "table":
        drawn = (lambda texts: sampled(texts, args.seed, args.each)) if args.what == "run" else survivors
        run(args.only or list(GROUPS), drawn, args.patience)
    print(table(_known()))


def run(groups: list[str], drawn: Callable[[dict[str, str]], list[Mutant]], patience: float) -> None:
    """Tries the mutants drawn from each group's files, by name, and those by hand; the killed are not tried again, nor survivors
    with a reason, and those whose line is no more are forgotten. Raises SystemExit where a group's tests fail on the tree as it
    is."""
    tree = Tree(MUTANTS_FOLDER.parents[1])
    try:
        texts = tree.texts()
        there = {m.key for m in every(texts)}
        known = {key: outcome for key, outcome in _known().items() if key in there}
        for group in groups:
            own = {f: t for f, t in texts.items() if group_of(f) == group}
            here = {m.key: m for m in (*by_hand(own), *drawn(own))}
            todo = [m for key, m in here.items() if known.get(key, NEW) == NEW and not reason(key)]
            if todo and (code := tree.run(group, None, None)) != 0:
                raise SystemExit(f"the tests of {group} do not pass on the tree as it is (pytest's exit code {code})")
            for mutant in todo:
                known[mutant.key] = tree.outcome(mutant, patience)
                OUTCOMES.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
                print(f"{known[mutant.key]:10} {mutant.file}:{mutant.number} ({mutant.kind}) {mutant.new.strip()}", flush=True)
    finally:
        tree.close()


def every(texts: dict[str, str]) -> list[Mutant]:
    return [*by_hand(texts), *(m for file, text in texts.items() for m in mutants(file, text))]


def sampled(texts: dict[str, str], seed: int, each: int) -> list[Mutant]:
    there = [m for file, text in texts.items() for m in mutants(file, text)]
    return Random(seed).sample(there, min(each, len(there)))


def survivors(texts: dict[str, str]) -> list[Mutant]:
    """Those known to have survived."""
    known = _known()
    return [m for m in every(texts) if known.get(m.key) == NEW]


def table(known: dict[str, str]) -> str:
    """Counts by package, the rate of all tried and of those without a reason to survive, and the survivors with theirs."""
    counts: dict[str, Counter[str]] = {}
    for key, outcome in known.items():
        file = key.split(":")[0]
        package = file.split("/")[1].removesuffix(".py")
        counts.setdefault(package, Counter())[outcome] += 1
        counts[package]["with a reason"] += outcome == "survived" and reason(key) is not None
    counts["all"] = sum(counts.values(), Counter())
    lines = [f"{'':14}{'tried':>8}" + "".join(f"{k:>15}" for k in COLUMNS_SHOWN) + f"{'rate':>8}{'of the others':>15}"]
    for package, c in counts.items():
        seen, tried = c["killed"] + c["timed out"], sum(c[k] for k in OUTCOME_KINDS)
        others = seen / max(tried - c["with a reason"], 1)
        lines.append(
            f"{package:14}{tried:8}" + "".join(f"{c[k]:15}" for k in COLUMNS_SHOWN) + f"{seen / max(tried, 1):8.1%}{others:15.1%}"
        )
    survivors = sorted(k for k, outcome in known.items() if outcome == "survived")
    return "\n".join([*lines, *(f"{reason(k) or 'NO TEST SEES IT'}: {k}" for k in survivors)])


def reason(key: str) -> str | None:
    """Why no test need see a mutant: by the first pattern of reasons.toml that its key fits."""
    return next((why for like, why in tomllib.loads(REASONS.read_text()).items() if fnmatchcase(key, like)), None)


def _known() -> dict[str, str]:
    return json.loads(OUTCOMES.read_text()) if OUTCOMES.exists() else {}


if __name__ == "__main__":
    main()
