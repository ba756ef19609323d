"""Measurement sets in and out.

    read(folder)  ->  Recording  ->  write(recording, folder)

    channels.py          what a channel name says: kind, index, axis, finger, SI unit
    recording.py         Recording, Trial, Clouds: SI, read-only, the only thing that travels
    fingerprint.py       a recording's hash
    quantity_strings.py  "10 g" to SI
    files.py             which files may be opened and how much of them is read
    tables.py            CSV and Parquet to columns; names the cell at fault
    clouds.py            point clouds (NPZ)
    conditions.py        a trial's payload, temperature, gravity, tip force
    plausible.py         what the numbers must satisfy
    notices.py           what a user should know though nothing is wrong
    read.py, write.py    the set as a whole
    toml_text.py         TOML on writing

Whatever breaks the contract is refused with one `DataError` that names file, row and column.
"""

from twin.measurements.channels import KINDS, Channel, Meaning, Role, meaning
from twin.measurements.read import read
from twin.measurements.recording import Clouds, Condition, Recording, Trial
from twin.measurements.write import write

__all__ = ["KINDS", "Channel", "Clouds", "Condition", "Meaning", "Recording", "Role", "Trial", "meaning", "read", "write"]
