"""Write one measurement set:  python -m tools.simulators.articulated OUT --robot tendon_finger --effect tendon_friction --seed 5

Several --effect may be given, each scaled to leave --level sigmas by itself; without any the day is clean.
"""

from pathlib import Path

import tyro

from tools.simulators.articulated.day import Recipe, make_set


def main(out: tyro.conf.Positional[Path], recipe: tyro.conf.OmitArgPrefixes[Recipe]) -> None:
    """Write one measurement set into the folder `out`."""
    truth = make_set(out, recipe)
    for name, level in truth["level_alone"].items():
        print(f"{name}: {level:.2f} sigma at strength {truth['parameters'][name]['strength']:.4g}")
    print(out)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
