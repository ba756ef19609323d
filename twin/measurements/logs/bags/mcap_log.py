"""MCAP files: ROS 2 (msg and idl definitions), ROS 1 and JSON messages.

Records are read in the order of the file, without its index, so that a file whose recorder was killed is read as far as it goes.
"""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.bags.definitions import decoder_of_definition
from twin.measurements.logs.bags.messages import holds_no_numbers
from twin.measurements.logs.bags.topics import LOG_CLOCK, PUBLISH_CLOCK, Topics
from twin.measurements.logs.libraries import library
from twin.measurements.logs.streams import Log, Take

Decoder = Callable[[bytes], object]
EXPORT_METADATA = "twin-measurements"


def read_mcap(path: Path, parts: tuple[Path, ...] = ()) -> Log:
    """Return the log of an MCAP file, or of the `parts` of one that was split. Raises DataError if no message can be read."""
    topics, notes = Topics(), []
    for part in parts or (path,):
        notes += _read_file(part, topics)
    streams = topics.streams()
    if not streams:
        why = "; ".join([*notes, *(f"{topic}: {reason}" for topic, reason in topics.unread.items())]) or "it is empty"
        raise DataError(f"{path}: no message that can be read ({short_repr(why, 300)}); name another log")
    return Log(path, "MCAP", [Take(path.stem, streams)], tuple(notes), topics.unread)


def _read_file(path: Path, topics: Topics) -> list[str]:
    reader = library("mcap.stream_reader", "mcap").StreamReader
    exceptions = library("mcap.exceptions", "mcap")
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    decoders: dict[int, Decoder | None] = {}
    before = topics.count
    try:
        with path.open("rb") as file:
            for record in reader(file, validate_crcs=True, record_size_limit=path.stat().st_size).records:
                kind = type(record).__name__
                if kind == "Schema":
                    schemas[record.id] = record
                elif kind == "Metadata" and record.name == EXPORT_METADATA:
                    topics.units |= _exported_units(record.metadata)
                elif kind == "Channel":
                    channels[record.id] = record
                elif kind == "Message" and record.channel_id in channels:
                    channel = channels[record.channel_id]
                    _add(topics, channel, schemas.get(channel.schema_id), record, decoders)
    except exceptions.InvalidMagic:
        raise DataError(f"{path}: no MCAP file (it does not begin as one); was it copied whole?") from None
    except (
        exceptions.McapError,
        ValueError,
        KeyError,
        struct.error,
        EOFError,
        MemoryError,
        RuntimeError,
        *_unpacking_errors(),
    ) as fault:
        what = str(fault) or type(fault).__name__
        return [f"{path.name} breaks off ({short_repr(what, 100)}): the {topics.count - before} messages before that are read"]
    except OSError as fault:
        raise DataError(f"{path}: cannot be read ({fault.strerror or fault}); choose another file") from None
    return []


def _exported_units(metadata: dict[str, str]) -> dict[str, str]:
    """Return the units of topics as `twin export` notes them, or none from metadata of another kind."""
    try:
        return {topic: str(unit) for topic, _, unit in json.loads(metadata["channels"]).values()}
    except (KeyError, ValueError, TypeError, AttributeError):
        return {}


def _unpacking_errors() -> tuple[type[Exception], ...]:
    return (library("zstandard", "zstandard").ZstdError,)


def _add(topics: Topics, channel: Any, schema: Any, message: Any, decoders: dict[int, Decoder | None]) -> None:
    kind = schema.name if schema is not None else channel.message_encoding
    if channel.id not in decoders:
        decoders[channel.id] = _decoder(topics, channel, schema)
    decode = decoders[channel.id]
    if decode is None:
        return
    try:
        decoded = decode(message.data)
    except Exception as fault:  # a message that does not fit its own definition: the libraries answer with anything
        topics.skip(channel.topic, f"a message that does not fit its definition ({short_repr(str(fault))})")
        return
    topics.add(channel.topic, kind, decoded, {LOG_CLOCK: message.log_time, PUBLISH_CLOCK: message.publish_time})


def _decoder(topics: Topics, channel: Any, schema: Any) -> Decoder | None:
    """Return what decodes a channel's messages, or None, with the reason noted."""
    named = "(none)" if schema is None else schema.name
    if schema is not None and holds_no_numbers(schema.name):
        topics.skip(channel.topic, f"{schema.name} holds no numbers for channels")
        return None
    encoding, definition = channel.message_encoding, "" if schema is None else schema.encoding
    try:
        if encoding == "json":
            return json.loads
        if encoding == "cdr" and definition == "ros2msg":
            return library("mcap_ros2.decoder", "mcap-ros2-support").DecoderFactory().decoder_for(encoding, schema)
        if schema is not None and encoding in ("cdr", "ros1") and definition in ("ros2idl", "ros1msg"):
            return decoder_of_definition(schema.name, schema.data.decode(), definition)
    except DataError:
        raise
    except Exception as fault:  # definitions come from strangers, and the parsers answer with anything
        topics.skip(channel.topic, f"its definition {named} cannot be read ({short_repr(str(fault))})")
        return None
    topics.skip(channel.topic, f"encoding {encoding} with {definition or 'no'} definitions is not read; ROS 2, ROS 1 and JSON are")
    return None
