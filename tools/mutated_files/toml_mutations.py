"""Mistakes in TOML files, made in their text."""

from __future__ import annotations

import re
from collections.abc import Callable
from random import Random

NUMBER = re.compile(r"(?<![\w.\"])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.\"])")
TEXT = re.compile(r'"[^"\n]*"')
KEY = re.compile(r'(?m)^(?:"[^"\n]+"|[A-Za-z_]+)(?=\s*=)|(?<=[{,]\s)[a-z]+(?=\s*=)')
HEADER = re.compile(r"(?m)^\[+[a-z]+\]+")
UNIT = re.compile(r'(unit\s*=\s*)"[^"\n]*"')
NUMBERS = (
    "0", "0.0", "-0.0", "-1", "-1.0", "1e999", "-1e308", "1e308", "1e-320", "nan", "inf", "-inf", "true", "false", '"5"', '""',
    "[]",
    "[1.0]", "[1.0, 2.0]", "[[1.0]]", "{ }", "{ value = 1.0 }", "9223372036854775807", "-9223372036854775808", "9" * 400,
    "9" * 5000, "1979-05-27", "07:32:00", "1e3", "1e6", "1e-6", "0x10", "1_000", "0.5", "2", "3", "1000000",
)  # fmt: skip
UNITS = (
    "", " ", "1", "m", "mm", "km", "um", "inch", "g", "kg", "Pa", "kPa", "MPa", "GPa", "deg", "rad", "deg**2", "rad/s", "degC",
    "degF",
    "K", "delta_degC", "9**9**9", "m**9**9", "((m**99)**99)**99", "10 mm", "mm mm/mm", "N", "gf", "lux", "%", "percent", "dB",
    "turn",
    "furlong", "m" * 5000, "s", "ms", "hour", "N*m", "1/K", "mm/N", "ångström", "µm", "None", "nan", "m\\u0000", "[m]", "2*m",
    "m^1",
)  # fmt: skip
WORDS = (
    "", " ", "..", "../..", "/etc", ".", "continuum.x", "robot", "schema", "os", "__init__", "body", "continuum_schema", "cast",
    "wire",
    "tentacle", "x" * 5000, "[/]", "[red]x", "\\u001b[31m", "\\u0000", "\\n", "nan", "twin/1", "a.csv", "b.csv", "a.clouds.npz",
    "input",
    "output", "context", "10 g g/g", "-10 g", "10", "1e999 g", "10 mm", "[0, 0, 1] N", "[0, 0] N", "tip_y", "tip_x", "disk_1_x",
    "disk_999_x",
    "tendon_1_tension", "tendon_2_displacement", "finger_1_tip_x", "simulation", "tendon_friction", "tip_payload", "disk",
)  # fmt: skip


def mutated(text: str, random: Random) -> bytes:
    """A text with one mistake, sometimes two or three."""
    data: str | bytes = text
    mistakes = random.choice((1, 1, 1, 2, 3))
    while mistakes and isinstance(data, str):
        before, data = data, random.choice(MUTATIONS)(data, random)
        mistakes -= data != before
    return data if isinstance(data, bytes) else data.encode("utf-8", "surrogatepass")


def _replaced(text: str, pattern: re.Pattern[str], random: Random, new: Callable[[re.Match[str]], str]) -> str:
    found = list(pattern.finditer(text))
    if not found:
        return text
    at = random.choice(found)
    return text[: at.start()] + new(at) + text[at.end() :]


def misspelt(word: str, random: Random) -> str:
    """One letter dropped, doubled, swapped, changed, or the word in capitals."""
    at = random.randrange(max(len(word), 1))
    return random.choice(
        (
            word[:at] + word[at + 1 :], word[:at] + word[at : at + 1] + word[at:],
            word[:at] + word[at + 1 : at + 2] + word[at : at + 1] + word[at + 2 :],
            word[:at] + "x" + word[at + 1 :], word.upper(), word.capitalize(), word + "s", word + "_1", word + "_x",
        )
    )  # fmt: skip


def _key(match: re.Match[str], random: Random) -> str:
    whole = match[0]
    return f'"{misspelt(whole[1:-1], random)}"' if whole.startswith('"') else misspelt(whole, random)


def _number(text: str, random: Random) -> str:
    return _replaced(text, NUMBER, random, lambda m: random.choice(NUMBERS))


def _scaled(text: str, random: Random) -> str:
    factor = random.choice((-1.0, 1e-3, 1e3, 1e6, 1e-6, 1e9, 57.29577951308232, 1.01))
    return _replaced(text, NUMBER, random, lambda m: repr(float(m[0]) * factor))


def _unit(text: str, random: Random) -> str:
    return _replaced(text, UNIT, random, lambda m: f'{m[1]}"{random.choice(UNITS)}"')


def _word(text: str, random: Random) -> str:
    return _replaced(text, TEXT, random, lambda m: random.choice((f'"{random.choice(WORDS)}"', "5", "true", "[]", "{ }")))


def _lines(text: str, random: Random) -> str:
    """A line dropped, doubled, moved, or made up."""
    lines = text.splitlines()
    at = random.randrange(len(lines))
    kind = random.randrange(4)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(at, lines[at])
    elif kind == 2:
        lines.insert(random.randrange(len(lines)), lines.pop(at))
    else:
        made_up = (
            "unknown = 1", '"tendons.twist" = { value = 1.0, unit = "deg", source = "x" }', "[unknown]", "[[effect]]",
            'id = "tendon_friction"',
            "std = 1.0", "a = " + "[" * 5000 + "]" * 5000, "a = " + "{ b = " * 3000, ".".join("a" * 2000) + " = 1",
            "#" + "x" * 10**6,
            'wind = "3 m/s"', 'tip_paylod = "10 g"', "[[trial]]", "[[channel]]", "strat = 5.0",
        )  # fmt: skip
        lines.insert(at, random.choice(made_up))
    return "\n".join(lines) + "\n"


def _entry(text: str, random: Random) -> str:
    """Something added to an inline table, or taken out of it."""
    if random.random() < 0.5:
        added = (
            "std = 1.0",
            "std = -1.0",
            "std = 0",
            "low = 0.0",
            "high = 1e9",
            "Std = 1.0",
            "vlaue = 1.0",
            'unit = "m"',
            'std = "x"',
            "std = true",
        )
        return _replaced(text, re.compile(r"\{ ?(?=\w)"), random, lambda m: "{ " + random.choice(added) + ", ")
    return _replaced(text, re.compile(r"\b(?:std|low|high|unit|source|value) = [^,}\n]+(?:, )?"), random, lambda m: "")


def _listed(text: str, random: Random) -> str:
    """A list made longer, shorter or upside down."""

    def changed(match: re.Match[str]) -> str:
        cells = match[0][1:-1].split(",")
        ways = ([*cells, cells[-1]], cells[:-1], cells[::-1], [match[0], *cells], ["true", *cells[1:]], ['"x"', *cells[1:]])
        return "[" + ",".join(random.choice(ways)) + "]"

    return _replaced(text, re.compile(r"\[[^\[\]\n\"]*\d[^\[\]\n]*\]"), random, changed)


def _bytes(text: str, random: Random) -> bytes:
    """Cut off, another encoding, or a damaged byte."""
    data = bytearray(text.encode())
    kind = random.randrange(8)
    if kind == 0:
        return bytes(data[: random.randrange(len(data))])
    if kind == 1:
        return text.encode(random.choice(("utf-16", "utf-32", "utf-8-sig")))
    if kind == 2:
        return (text + "# Ångström").encode("latin-1", "replace")
    if kind == 3:
        return text.replace("\n", random.choice(("\r\n", "\r", "\n\n"))).encode()
    if kind == 4:
        return b""
    for _ in range(random.randrange(1, 4)):
        data[random.randrange(len(data))] = random.randrange(256)
    return bytes(data)


MUTATIONS = (
    _number, _number, _scaled, _unit, _unit, _word, _lines, _lines, _entry, _listed, _bytes,
    lambda text, random: _replaced(text, KEY, random, lambda m: _key(m, random)),
    lambda text, random: _replaced(text, KEY, random, lambda m: _key(m, random)),
    lambda text, random: _replaced(text, HEADER, random, lambda m: misspelt(m[0], random)),
)  # fmt: skip
