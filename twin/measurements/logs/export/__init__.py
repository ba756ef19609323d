"""Measurement sets in the formats of other programs."""

from twin.measurements.logs.export.lerobot_folder import write_lerobot
from twin.measurements.logs.export.mcap_file import write_mcap
from twin.measurements.logs.export.parquet_folder import write_parquet

__all__ = ["write_lerobot", "write_mcap", "write_parquet"]
