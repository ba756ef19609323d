"""Mistakes in point clouds (NPZ)."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable
from random import Random

import numpy as np

from tools.mutated_files.sources import clouds

Arrays = dict[str, np.ndarray]
Change = Callable[[Arrays, str, Random], Arrays]


def mutated_clouds(random: Random) -> bytes:
    if random.random() < 0.15:
        return _claiming(random)
    arrays: Arrays = dict(clouds())
    name = random.choice(list(arrays))
    if random.random() < 0.6:
        arrays = random.choice(CHANGES)(arrays, name, random)
    stream = io.BytesIO()
    random.choice((np.savez, np.savez_compressed))(stream, **arrays)  # type: ignore[operator]
    data = bytearray(stream.getvalue())
    if random.random() < 0.5:
        for _ in range(random.randrange(1, 6)):
            data[random.randrange(len(data))] = random.randrange(256)
        if random.random() < 0.3:
            del data[random.randrange(len(data)) :]
    return bytes(data)


def _changed(value: Callable[[np.ndarray], object]) -> Change:
    return lambda arrays, name, random: {**arrays, name: np.asarray(value(arrays[name]))}


CHANGES: tuple[Change, ...] = (
    _changed(lambda a: a[:-1]),
    _changed(lambda a: a[::-1]),
    _changed(lambda a: a * -1),
    _changed(lambda a: a * 1000),
    _changed(lambda a: a.astype(complex)),
    _changed(lambda a: a.astype(str)),
    _changed(lambda a: a.astype(bool)),
    _changed(lambda a: a.astype(np.float16)),
    _changed(lambda a: a.astype(">f8")),
    _changed(lambda a: a.astype(np.int64)),
    _changed(lambda a: a.astype(object)),
    _changed(lambda a: np.full(a.shape, np.nan)),
    _changed(lambda a: np.full(a.shape, np.inf)),
    _changed(lambda a: a[None]),
    _changed(lambda a: np.asfortranarray(a)),
    _changed(lambda a: np.array(3.0)),
    _changed(lambda a: a[:0]),
    lambda arrays, name, random: {key: value for key, value in arrays.items() if key != name},
    lambda arrays, name, random: {**arrays, "colour": np.zeros(3)},
    lambda arrays, name, random: {("_" + key if key == name else key): value for key, value in arrays.items()},
)


def _claiming(random: Random) -> bytes:
    """A member whose header claims more than it holds, or that unpacks to a great deal."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        if random.random() < 0.3:
            archive.writestr("points.npy", bytes(300 * 2**20))
        else:
            shape = random.choice(("(99999999999, 3)", "(-1, 3)", "(5, 3)", "()", "(True, 3)", "(5.0, 3)"))
            header = f"{{'descr': '{random.choice(('<f8', '|i1', '|O', 'x'))}', 'fortran_order': False, 'shape': {shape}, }}\n"
            body = bytes(random.choice((0, 120, 10**6)))
            archive.writestr("points.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + body)
        for name in ("offsets", "time"):
            part = io.BytesIO()
            np.save(part, clouds()[name])
            archive.writestr(f"{name}.npy", part.getvalue())
    return stream.getvalue()
