"""Point clouds in NPZ files of plain arrays. Sizes are checked before unpacking, and pickled objects are refused."""

import io
import math
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path

import numpy as np

from twin.foundation.errors import DataError, short_repr
from twin.foundation.files import MAX_CLOUD_BYTES, check_file_size, prefix_errors
from twin.measurements.recording import Clouds

_MEMBERS = ("points", "offsets", "time")
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def read_clouds(path: Path) -> Clouds:
    """Read the clouds of one trial.

    Raises DataError for a file that is not an NPZ of points (M, 3), offsets (F + 1,) and time (F,), that is or unpacks to more
    than `MAX_CLOUD_BYTES` bytes, or that holds pickled objects.
    """
    check_file_size(path, MAX_CLOUD_BYTES)
    with prefix_errors(path):
        try:
            with zipfile.ZipFile(path) as archive:
                arrays = _members(archive)
        except (zipfile.BadZipFile, zlib.error, struct.error, OSError, EOFError, ValueError, RuntimeError, OverflowError) as fault:
            # zipfile raises RuntimeError for encrypted members.
            raise DataError(f"cannot be read as NPZ ({short_repr(str(fault))}); write it with numpy.savez_compressed") from None
        return Clouds(**arrays)


def _members(archive: zipfile.ZipFile) -> dict[str, np.ndarray]:
    names = sorted(info.filename for info in archive.infolist())
    if names != sorted(f"{name}.npy" for name in _MEMBERS):
        raise DataError(f"holds {short_repr(', '.join(names))}; exactly points, offsets and time are allowed")
    if any(info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for info in archive.infolist()):
        raise DataError("is packed in an unusual way; write it with numpy.savez_compressed")
    if (declared := sum(info.file_size for info in archive.infolist())) > MAX_CLOUD_BYTES:
        raise DataError(f"unpacks to {declared} bytes; at most {MAX_CLOUD_BYTES} are read, use fewer points or frames")
    arrays = {}
    for name in _MEMBERS:
        info = archive.getinfo(f"{name}.npy")
        with archive.open(info) as member, prefix_errors(name):
            # Read only the declared size: a directory that understates a member then cannot make it unpack further.
            arrays[name] = _array(member.read(info.file_size), "iu" if name == "offsets" else "iuf")
    return arrays


def _array(data: bytes, kinds: str) -> np.ndarray:
    """Parse one .npy file; its header must agree with the bytes behind it."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        shape, fortran, dtype = _HEADERS[version](stream, max_header_size=4096)
    except (ValueError, KeyError, TypeError, SyntaxError, tokenize.TokenError, RecursionError, MemoryError):
        raise DataError("is no plain .npy array; write it with numpy.savez_compressed") from None
    if dtype.kind not in kinds:
        raise DataError(f"has type {short_repr(str(dtype))}; {'integers are' if kinds == 'iu' else 'numbers are'} needed")
    body = data[stream.tell() :]
    if any(isinstance(size, bool) or size < 0 for size in shape) or math.prod(shape) * dtype.itemsize != len(body):
        raise DataError(f"declares shape {short_repr(shape)} but holds {len(body)} bytes; write it again")
    if math.prod(shape) > MAX_CLOUD_BYTES // 8:  # small integers grow when converted to floats
        raise DataError(
            f"has shape {short_repr(shape)}; at most {MAX_CLOUD_BYTES // 8} numbers are read, use fewer points or frames"
        )
    return np.frombuffer(body, dtype).reshape(shape, order="F" if fortran else "C")
