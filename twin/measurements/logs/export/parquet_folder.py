"""A measurement set with a Parquet table a trial."""

from pathlib import Path

from twin.measurements.recording import Recording
from twin.measurements.write import write


def write_parquet(recording: Recording, folder: Path) -> None:
    """Write a set whose trials are Parquet, in the units its channels declare. Raises DataError as `write`."""
    write(recording, folder, file_format="parquet")
