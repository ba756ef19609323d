"""Random shapes of a finger to train estimators on, under drawn tendon commands and pushes.

draw.py      random chains of samples           solve.py   their equilibria generate.py  shards in parallel, resumable      shard.py
Parquet in and out vary.py      further differences between fingers
"""

from twin.shape.training_data.generate import GenerationOrder, bytes_needed, generate_shards, uncertain_parameters
from twin.shape.training_data.vary import parse_spreads

__all__ = ["GenerationOrder", "bytes_needed", "generate_shards", "parse_spreads", "uncertain_parameters"]
