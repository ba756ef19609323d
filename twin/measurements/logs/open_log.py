"""Opening of a log of any format that is read; what it is is found out from its contents, not from its name."""

from pathlib import Path

from twin.foundation.errors import DataError
from twin.measurements.logs.bags.mcap_log import read_mcap
from twin.measurements.logs.bags.rosbag import BAG_FILE, read_ros1_bag, read_ros2_bag
from twin.measurements.logs.streams import Log, Stream, Take
from twin.measurements.logs.tables.delimited import read_delimited
from twin.measurements.logs.tables.folder import read_folder, stem
from twin.measurements.logs.tables.json_log import read_json
from twin.measurements.logs.tables.lerobot import INFO_FILE, read_lerobot
from twin.measurements.logs.tables.motive import FIRST_CELL, read_motive
from twin.measurements.logs.tables.parquet import read_parquet
from twin.measurements.logs.tables.text_files import read_head
from twin.measurements.read import SET_FILE

FORMATS = "MCAP, ROS 1 and ROS 2 bags, LeRobot folders, Motive CSV, CSV and other text tables, Parquet, JSON, or a folder of tables"
_REFUSED = {
    b"\x89HDF": "an HDF5 file", b"PK\x03\x04": "a zip, xlsx or npz file", b"\x93NUMPY": "a NumPy array", b"MATLAB": "a MATLAB file",
    b"#ROSBAG V1": "a ROS bag of version 1 (rosbag fix converts it)",
}  # fmt: skip


def open_log(path: str | Path) -> Log:
    """Read a log: a file or a folder of one of `FORMATS`.

    Raises DataError for a path that does not exist, a format that is not read, and a log without anything to read.
    """
    path = Path(path)
    try:
        there, is_folder = path.exists(), path.is_dir()
    except (OSError, ValueError):
        there, is_folder = False, False
    if not there:
        raise DataError(f"{path}: no such file or folder; name a log ({FORMATS})")
    return _open_folder(path) if is_folder else _open_file(path)


def _open_folder(path: Path) -> Log:
    if (path / SET_FILE).exists():
        raise DataError(f"{path}: is a measurement set already; nothing to import")
    if (path / INFO_FILE).exists():
        return read_lerobot(path)
    if (path / BAG_FILE).exists() or any(path.glob("*.db3")):
        return read_ros2_bag(path)
    bags = sorted([*path.glob("*.mcap"), *path.glob("*.bag")])
    files = sorted(each for each in path.iterdir() if each.is_file() and not each.name.startswith(".") and not _is_about(each))
    tables = [each for each in files if each not in bags]
    if bags:
        return _open_bags(path, bags, tables)
    if not tables:
        raise DataError(f"{path}: a folder without a log; name a log ({FORMATS})")
    return read_folder(path, tables, _read_table)


def _open_bags(path: Path, bags: list[Path], tables: list[Path]) -> Log:
    """Return the log of a folder of bags, one take each; tables beside a single bag are further streams of its take."""
    logs = [_open_file(bag) for bag in bags]
    takes = [Take(log.path.stem, take.streams) for log in logs for take in log.takes]
    name = f"folder of {len(bags)} bag{'s' if len(bags) > 1 else ''}"
    if tables and len(takes) == 1:
        beside = read_folder(path, tables, _read_table)
        if len(beside.takes) == 1:
            takes = [Take(takes[0].name, {**takes[0].streams, **beside.takes[0].streams})]
            logs.append(beside)
            tables = []
            name += " and tables"
    unread = {topic: why for log in logs for topic, why in log.unread.items()}
    unread |= {each.name: "a table beside several runs, which cannot be told apart" for each in tables}
    return Log(path, name, takes, tuple(note for log in logs for note in log.notes), unread)


def _is_about(path: Path) -> bool:
    """Return whether a file beside logs is a text about them, or a robot's description."""
    return path.suffix.lower() in (
        ".md",
        ".toml",
        ".yaml",
        ".yml",
        ".xml",
        ".urdf",
        ".py",
        ".m",
        ".pdf",
        ".png",
        ".jpg",
        ".mp4",
    ) or (path.stem.upper().startswith(("README", "LICENSE", "LICENCE")))


def _open_file(path: Path) -> Log:
    head = read_head(path)
    if head.startswith(b"\x89MCAP"):
        return read_mcap(path)
    if head.startswith(b"#ROSBAG V2"):
        return read_ros1_bag(path)
    if head.startswith(b"SQLite format 3"):
        return read_ros2_bag(path)
    stream, notes = _read_table(path, stem(path))
    return Log(path, stream.kind, [Take(stem(path), {stream.name: stream})], notes)


def _read_table(path: Path, name: str) -> tuple[Stream, tuple[str, ...]]:
    """Return a file that is a table as a stream. Raises DataError for a format that is not read."""
    head = read_head(path)
    for magic, what in _REFUSED.items():
        if head.startswith(magic):
            raise DataError(f"{path}: is {what}, which is not read; write it as CSV, Parquet or MCAP")
    if head.startswith(b"PAR1"):
        return read_parquet(path, name)
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if text.startswith((b"{", b"[")):
        return read_json(path, name)
    if text.startswith(FIRST_CELL.encode()):
        return read_motive(path, name)
    return read_delimited(path, name)
