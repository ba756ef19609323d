"""ROS 1 bags, and ROS 2 bags in sqlite3 files, by the rosbags library."""

from pathlib import Path
from typing import Any

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.bags.definitions import Decoder, decoder_of_definition, decoder_of_distribution
from twin.measurements.logs.bags.mcap_log import read_mcap
from twin.measurements.logs.bags.messages import holds_no_numbers
from twin.measurements.logs.bags.topics import LOG_CLOCK, Topics
from twin.measurements.logs.libraries import library
from twin.measurements.logs.streams import Log, Take

BAG_FILE = "metadata.yaml"


def read_ros1_bag(path: Path) -> Log:
    """Return the log of a ROS 1 bag. Raises DataError for a file that is none, broken, or without a readable message."""
    reader = library("rosbags.rosbag1", "rosbags").Reader
    return _read([path], path, "ROS 1 bag", reader, "repair it (rosbag reindex FILE), or record it again")


def read_ros2_bag(path: Path) -> Log:
    """Return the log of a ROS 2 bag: its folder, or a .db3 file. Raises DataError for one broken or without a readable message."""
    if path.is_dir() and (parts := tuple(sorted(path.glob("*.mcap")))):
        return read_mcap(path, parts)
    reader = library("rosbags.rosbag2", "rosbags").Reader
    parts = (path,) if path.is_file() or (path / BAG_FILE).exists() else tuple(sorted(path.glob("*.db3")))
    return _read(parts, path, "ROS 2 bag (sqlite3)", reader, "repair it (ros2 bag reindex FOLDER), or record it again")


def _read(parts: Any, path: Path, name: str, reader: Any, way_out: str) -> Log:
    topics, notes = Topics(), []
    for part in parts:
        before = topics.count
        try:
            with reader(part) as bag:
                _read_messages(bag, topics, ros1=name.startswith("ROS 1"))
        except DataError:
            raise
        except Exception as fault:  # of a broken file the library answers with errors of many kinds
            what = short_repr(str(fault) or type(fault).__name__, 200)
            if topics.count == before:
                raise DataError(f"{part}: cannot be read as a {name} ({what}); {way_out}") from None
            notes.append(f"{part.name} breaks off ({what}): the {topics.count - before} messages before that are read")
    streams = topics.streams()
    if not streams:
        why = "; ".join(f"{topic}: {reason}" for topic, reason in topics.unread.items()) or "it is empty"
        raise DataError(f"{path}: no message that can be read ({short_repr(why, 300)}); name another log")
    return Log(path, name, [Take(path.stem, streams)], tuple(notes), topics.unread)


def _read_messages(bag: Any, topics: Topics, ros1: bool) -> None:
    decoders: dict[int, Decoder | None] = {each.id: _decoder(topics, each, ros1) for each in bag.connections}
    for connection, stamp, data in bag.messages():
        decode = decoders[connection.id]
        if decode is None:
            continue
        try:
            decoded = decode(data)
        except Exception as fault:  # a message that does not fit its own definition
            topics.skip(connection.topic, f"a message that does not fit its definition ({short_repr(str(fault))})")
            continue
        topics.add(connection.topic, connection.msgtype, decoded, {LOG_CLOCK: stamp})


def _decoder(topics: Topics, connection: Any, ros1: bool) -> Decoder | None:
    """Return what decodes a connection's messages, or None, with the reason noted."""
    kind, definition = connection.msgtype, connection.msgdef
    if holds_no_numbers(kind):
        topics.skip(connection.topic, f"{kind} holds no numbers for channels")
        return None
    try:
        if definition.data:
            encoding = "ros1msg" if ros1 else "ros2idl" if definition.format.name == "IDL" else "ros2msg"
            return decoder_of_definition(kind, definition.data, encoding)
        found = decoder_of_distribution(kind, ros1)
        if found is None:
            topics.skip(
                connection.topic, f"the bag does not carry the definition of {kind}; convert it to MCAP where ROS knows the type"
            )
        return found
    except DataError:
        raise
    except Exception as fault:  # definitions come from strangers, and the parsers answer with anything
        topics.skip(connection.topic, f"the definition of {kind} cannot be read ({short_repr(str(fault))})")
        return None
