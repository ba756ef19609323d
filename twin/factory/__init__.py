"""The data factory: many shapes of a finger under random tendon commands and random hands, for what is learned from them.

draw.py      what a chain of samples is asked     points.py    the named points of a body
solve.py     its equilibria                        generate.py  shards by several processes, resumable
shard.py     Parquet in and out             vary.py     what else may differ between fingers
"""

from twin.factory.generate import Order, doubts, generate, need
from twin.factory.points import Points, named_points
from twin.factory.vary import varied

__all__ = ["Order", "Points", "doubts", "generate", "named_points", "need", "varied"]
