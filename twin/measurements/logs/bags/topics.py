"""Messages of a bag, gathered into streams; shared by the readers of MCAP and ROS bags."""

from collections.abc import Mapping

from twin.measurements.logs.bags.messages import flatten, header_stamp, own_stamp, split_message
from twin.measurements.logs.streams import Stream, StreamBuilder

HEADER_CLOCK, OWN_CLOCK, LOG_CLOCK, PUBLISH_CLOCK = "header.stamp", "stamp", "log time", "publish time"

MAX_STAMP = 2**62  # ns since 1970: the year 2116


class Topics:
    """Streams by topic, and the topics whose messages cannot be read, with the first reason."""

    def __init__(self) -> None:
        self._builders: dict[str, StreamBuilder] = {}
        self.unread: dict[str, str] = {}
        self.units: dict[str, str] = {}  # of the plain numbers of a topic, where the log says them
        self.count = 0

    def add(self, topic: str, kind: str, message: object, stamps: Mapping[str, int]) -> None:
        """Add a decoded message with the recorder's stamps in ns."""
        if not all(isinstance(stamp, int) and 0 <= stamp < MAX_STAMP for stamp in stamps.values()):
            self.skip(topic, "a message whose recorded stamp is no time; it is left out")
            return
        self.count += 1
        for name, of_kind, part in split_message(topic, kind, message):
            builder = self._builders.get(name)
            if builder is None:
                builder = self._builders[name] = StreamBuilder(name, of_kind)
            builder.add({HEADER_CLOCK: header_stamp(part), OWN_CLOCK: own_stamp(part), **stamps}, flatten(part))

    def skip(self, topic: str, why: str) -> None:
        """Note that a topic is not read."""
        self.unread.setdefault(topic, why)

    def streams(self) -> dict[str, Stream]:
        """Return the streams, rows in the order of the log's time."""
        return {name: builder.build(LOG_CLOCK, self.units.get(name, "")) for name, builder in sorted(self._builders.items())}
