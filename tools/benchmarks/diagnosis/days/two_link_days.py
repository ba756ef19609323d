"""How often the diagnosis names what is wrong with a two-link finger, on fresh days of tools/simulators/two_link.py.

    python -m tools.benchmarks.diagnosis.days.two_link_days OUT [FIRST_SEED]

What bends this finger is the difference of its two tensions: a load cell's gain and crosstalk from the other are one and the same
to it. Days with either are run too, after the twelve, and should end in the two being called inseparable. A load cell's bias is
left out: it bends the joints as their springs' rest angles do, which a built finger may be off by.
"""

from pathlib import Path

import tyro

from tools.benchmarks.diagnosis.answer import answer, errors_in_words, in_words
from tools.simulators.two_link import write_day

EFFECT_PER_DAY = (
    None, None, "tendon_friction", "tendon_friction", "load_cell_drift", "load_cell_drift", "tip_payload", "tip_payload",
    "base_tilt", "time_delay", "actuator_saturation", "temperature_softening",
)  # fmt: skip
INSEPARABLE_EFFECTS = ("load_cell_gain", "load_cell_crosstalk")


def main(out: tyro.conf.Positional[Path], first_seed: tyro.conf.Positional[int] = 21000) -> None:
    """Make the days that are missing, diagnose them and print the score."""
    right = 0
    for n, effect in enumerate((*EFFECT_PER_DAY, *INSEPARABLE_EFFECTS)):
        folder = out / f"{first_seed + n}_{effect or 'none'}"
        if not folder.exists():
            write_day(folder, effect, first_seed + n)
        row, _ = answer(folder, 0)
        rivals = sorted(row.get("ambiguous", [])) == [[e] for e in sorted(INSEPARABLE_EFFECTS)]
        ok = rivals and not row["claims"] if effect in INSEPARABLE_EFFECTS else row["claims"][:1] == ([effect] if effect else [])
        right += ok and n < len(EFFECT_PER_DAY)
        said = f"{in_words(row)} {'ok' if ok else 'WRONG'}; held out, calibrated / after / floor: {errors_in_words(row)} mm"
        print(f"{first_seed + n} {effect or 'none'}: {said}", flush=True)
    print(f"right first: {right} of {len(EFFECT_PER_DAY)}")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
