"""Import of logs of other programs as measurement sets, and export to them.

    open_log(path)  ->  Log  ->  map_text(log)   a commented map for the user to fill in
                          |
    read_map(file)  ->  assemble(log, map)  ->  Recording  ->  twin.measurements.write
    read(set)       ->  export/              MCAP, LeRobot v3

    readers/        one module a format; each gives streams of fields with the clocks that stamp them
    streams.py      Log, Take, Stream, Field, Clock
    clocks.py       which clock, its unit, skew, rate and gaps
    guess.py        proposals of quantity, role and unit
    map/            the map: as it is written first, and as the user leaves it
    stamps.py       streams on one time line
    cut.py          trials by gaps and marks
    assemble.py     log and map to recording

What cannot be known from a log is asked for, by line, and never assumed.
"""

from twin.measurements.logs.assemble import assemble
from twin.measurements.logs.map.map_file import read_map
from twin.measurements.logs.map.map_text import map_text
from twin.measurements.logs.open_log import open_log

__all__ = ["assemble", "map_text", "open_log", "read_map"]
