"""Reading and writing of measurement sets.

    read(folder)  ->  Recording  ->  write(recording, folder)

    read.py, write.py            a whole set
    recording.py                 Recording, Trial, Clouds: SI, read-only
    fingerprint.py               a recording's hash
    channels.py                  channel names: kind, index, axis, finger, SI unit
    conditions.py                a trial's payload, temperature, gravity, tip force
    clouds.py                    point clouds (NPZ)
    patches.py                   point clouds as outputs that can be predicted
    notices.py                   remarks on a set that is otherwise in order
    logs/                        other programs' logs to sets, and sets to their formats
    parsing/tables.py            CSV and Parquet to columns; names the cell at fault
    parsing/plausible.py         checks on the numbers
    parsing/quantity_strings.py  "10 g" to SI
    parsing/toml_text.py         TOML text

A set that breaks the contract is refused with one `DataError` that names file, row and column.
"""

from twin.measurements.channels import CHANNEL_KINDS, Channel, ChannelName, Role, parse_channel_name
from twin.measurements.read import read
from twin.measurements.recording import Clouds, Condition, Recording, Trial
from twin.measurements.write import write

__all__ = [
    "CHANNEL_KINDS",
    "Channel",
    "ChannelName",
    "Clouds",
    "Condition",
    "Recording",
    "Role",
    "Trial",
    "parse_channel_name",
    "read",
    "write",
]
