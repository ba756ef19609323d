"""Decoders of ROS messages from the definitions that a bag carries, by the rosbags library; each type has a store of its own.

One definition that cannot be read, or that two topics have in two versions, then costs its own topic only.
"""

from collections.abc import Callable

from twin.measurements.logs.libraries import library

Decoder = Callable[[bytes], object]
_IDL_LINE = "=" * 80 + "\n"


def decoder_of_definition(kind: str, definition: str, encoding: str) -> Decoder:
    """Return what decodes messages of type `kind` defined by `definition` ("ros2msg", "ros2idl" or "ros1msg")."""
    typesys = library("rosbags.typesys", "rosbags")
    name = full_name(kind)
    types = {}
    if encoding == "ros2idl":
        blocks = definition.split(_IDL_LINE)
        for block in blocks:
            text = block.split("\n", 1)[1] if block.startswith("IDL: ") else block
            if text.strip():
                types.update(typesys.get_types_from_idl(text))
    else:
        types.update(typesys.get_types_from_msg(definition, name))
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register({each: fields for each, fields in types.items() if each not in store.fielddefs})
    return _decoder(store, name, ros1=encoding == "ros1msg")


def decoder_of_distribution(kind: str, ros1: bool) -> Decoder | None:
    """Return what decodes messages of a type that ships with ROS, or None for another: for bags without definitions."""
    typesys = library("rosbags.typesys", "rosbags")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if ros1 else typesys.Stores.ROS2_HUMBLE)
    name = full_name(kind)
    return _decoder(store, name, ros1) if name in store.fielddefs else None


def full_name(kind: str) -> str:
    """Return a type's name as ROS 2 writes it: sensor_msgs/JointState -> sensor_msgs/msg/JointState."""
    package, _, name = kind.partition("/")
    return kind if "/" in name else f"{package}/msg/{name}"


def _decoder(store: object, name: str, ros1: bool) -> Decoder:
    decode = store.deserialize_ros1 if ros1 else store.deserialize_cdr  # type: ignore[attr-defined]
    return lambda data: decode(data, name)
