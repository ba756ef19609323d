"""The public rigs' raw data, fetched and checked:  python -m tools.benchmarks.hardware.fetch FOLDER [--check]

Every file of measured.csv comes from its commit on GitHub, is compared by SHA-256 with what the importers were written for, and is
laid out as `tools.benchmarks.hardware.run` expects; runs and sweeps are kept gzipped. With --check nothing is fetched: what lies in
FOLDER is compared. Origins and licences: soft tentacle, tud-phi/soromox, MIT; cable tool, MRDLab/mis-tool-characterization, ODbL
1.0, O'Neill et al. 2018, doi 10.1109/LRA.2018.2849862; three cables, ARM-Lab, MIT, Sincak et al. 2025, doi
10.1109/PC65047.2025.11047513. Which columns of a tentacle's file are which marker stands in importers/tentacle_points.csv.
"""

import csv
import gzip
import hashlib
import shutil
import sys
import urllib.request
from pathlib import Path

import tyro

HARDWARE_FOLDER = Path(__file__).parent
SWEEPS = "three-cable/Dataset.txt.gz"
ROWS_TAKEN = 20000  # of its 30,000 rows the importer was written for


def listed() -> list[dict[str, str]]:
    """Return file, url and sha256 (of the unpacked bytes) of every raw file."""
    with (HARDWARE_FOLDER / "measured.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def wrong(folder: Path) -> list[str]:
    """Return what of the raw data is missing in a folder or differs, in words; empty where all is there."""
    found = []
    for row in listed():
        path = folder / row["file"]
        if not path.is_file():
            found.append(f"{path}: missing")
        elif hashlib.sha256(_unpacked(path)).hexdigest() != row["sha256"]:
            found.append(f"{path}: its bytes are not those of {row['url']}")
    return found


def _unpacked(path: Path) -> bytes:
    data = path.read_bytes()
    try:
        return gzip.decompress(data) if path.suffix == ".gz" else data
    except (OSError, EOFError):
        return b""


def place(row: dict[str, str], data: bytes, folder: Path) -> None:
    """Write one file's bytes, as its origin has them, where the importers look. Raises ValueError where the hash is another."""
    if row["file"] == SWEEPS:
        data = b"".join(data.splitlines(keepends=True)[:ROWS_TAKEN])
    if hashlib.sha256(data).hexdigest() != row["sha256"]:
        raise ValueError(f"{row['url']}: not the bytes that {row['file']} should have; nothing is written")
    path = folder / row["file"]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)


def main(folder: tyro.conf.Positional[Path], check: bool = False) -> None:
    """Fetch the raw data and check them.

    Args:
        folder: where the raw data are to lie, one folder a rig
        check: fetch nothing, compare what is there
    """
    if not check:
        for row in listed():
            with urllib.request.urlopen(row["url"], timeout=60) as answer:
                place(row, answer.read(), folder)
        shutil.copy(HARDWARE_FOLDER / "importers/tentacle_points.csv", folder / "tentacle/static_points_derived.csv")
    if found := wrong(folder):
        sys.exit("\n".join(found))
    print(f"{folder}: {len(listed())} files, all as they should be")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
