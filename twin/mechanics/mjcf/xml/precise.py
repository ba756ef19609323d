"""An MJCF as text with every digit, its comments, and the files it needs beside it."""

from __future__ import annotations

import ctypes
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from os.path import normpath
from pathlib import Path
from threading import Lock

import mujoco
import numpy as np

from twin.foundation.errors import DataError
from twin.mechanics.mujoco_symbols import MUJOCO_LIBRARY

ASSETS = "assets"  # the folder of meshes, textures and height fields beside a written model
ALL_DIGITS, USUAL_DIGITS = 17, 6
_LONG_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_precision = ctypes.CDLL(str(MUJOCO_LIBRARY))._mjPRIVATE__set_xml_precision  # of all threads; MuJoCo's own way to write every digit
_writing = Lock()
_FOLDERS = {"mesh": "meshdir", "hfield": "meshdir", "skin": "meshdir", "texture": "texturedir"}  # the attribute with the folder
_SECTIONS = {
    "body": "worldbody", "joint": "worldbody", "geom": "worldbody", "site": "worldbody", "tendon": "tendon", "actuator": "actuator",
}  # fmt: skip
_TAGS = {"body": ("body",), "joint": ("joint", "freejoint"), "geom": ("geom",), "site": ("site",)}


@dataclass(frozen=True)
class WrittenModel:
    """An MJCF as text, and the files beside it by their names relative to it."""

    text: str
    files: Mapping[str, bytes]

    def compile(self) -> mujoco.MjModel:
        """Return the model that MuJoCo makes of it."""
        return mujoco.MjModel.from_xml_string(self.text, dict(self.files))

    def spec(self) -> mujoco.MjSpec:
        """Return it for editing."""
        return mujoco.MjSpec.from_string(self.text, assets=dict(self.files))


def exact_text(spec: mujoco.MjSpec) -> str:
    """Return a compiled spec as MJCF whose numbers are read back to the last bit, with as few digits as that takes.

    MuJoCo writes six digits, by which a prediction would change.
    """
    with _writing:
        _precision(ALL_DIGITS)
        try:
            text = spec.to_xml()
        finally:
            _precision(USUAL_DIGITS)
    return re.sub(r'="[^"]*"', lambda value: _LONG_NUMBER.sub(_shortest, value[0]), text)


def _shortest(number: re.Match[str]) -> str:
    """Return a number of 12 digits or more in the fewest that mean the same, one of single precision as such."""
    text = number[0]
    if sum(map(str.isdigit, text)) < 12:
        return text
    value = float(text)
    if np.isfinite(np.float32(value)) and float(np.float32(value)) == value:
        return str(np.float32(value))
    return repr(value).removesuffix(".0")


def self_contained(spec: mujoco.MjSpec, folder: Path) -> WrittenModel:
    """Return a compiled spec, whose files lie about `folder`, with includes resolved and its files in one folder beside it.

    Raises DataError for a file that cannot be read.
    """
    root = _tree(exact_text(spec))
    files = dict[str, bytes]()
    for element, name, there in _needed(root, folder):
        if not element.get("name"):
            element.set("name", there.stem)
        element.set(name, _file_name(files, there.name, _content(there)))
    for attribute in {*_FOLDERS.values(), "assetdir", "strippath"}:
        _folders(root).pop(attribute, None)
    return WrittenModel(ET.tostring(root, encoding="unicode"), files)


def copied(spec: mujoco.MjSpec, path: Path) -> WrittenModel:
    """Return the MJCF at `path`, whose compiled spec is given, as it stands, and the files beside it that it includes and needs.

    Where one lies outside its folder, it is written anew by `self_contained`. Raises DataError where it cannot be read.
    """
    folder = path.parent
    places = [*_included(path, folder), *(there for _, _, there in _needed(_tree(exact_text(spec)), folder))]
    within = [normpath(there.relative_to(folder)) for there in places if there.is_relative_to(folder)]
    if len(within) < len(places) or any(name.startswith("..") for name in within):
        return self_contained(spec, folder)
    files = {Path(name).as_posix(): _content(folder / name) for name in within}
    return WrittenModel(_content(path).decode("utf-8"), files)


def _included(path: Path, folder: Path) -> list[Path]:
    """Return the files that an MJCF of a model in `folder` includes, and those that they do."""
    found = []
    for element in _tree(_content(path).decode("utf-8")).iter("include"):
        there = next((p for at in (folder, path.parent) if (p := at / element.get("file", "")).is_file()), folder)
        if there != folder:
            found += [there, *_included(there, folder)]
    return found


def _needed(root: ET.Element, folder: Path) -> list[tuple[ET.Element, str, Path]]:
    """Return the elements that name a file, the attribute, and where the file lies."""
    folders = _folders(root)
    return [
        (element, name, folder / folders.get(_FOLDERS.get(element.tag, ""), "") / element.get(name, ""))
        for element in root.iterfind("asset/*")
        for name in element.keys()  # noqa: SIM118
        if name.startswith("file")
    ]


def _folders(root: ET.Element) -> dict[str, str]:
    compiler = root.find("compiler")
    return compiler.attrib if compiler is not None else {}


def _content(there: Path) -> bytes:
    try:
        return there.read_bytes()
    except OSError as error:
        raise DataError(f"{there}: cannot be read ({error.strerror or error}); the model needs it") from None


def _file_name(files: dict[str, bytes], name: str, content: bytes) -> str:
    """Add a file under a name that no other content has; return its path."""
    stem, dot, ending = name.partition(".")
    path, k = f"{ASSETS}/{name}", 1
    while files.get(path, content) != content:
        k += 1
        path = f"{ASSETS}/{stem}_{k}{dot}{ending}"
    files[path] = content
    return path


def with_comments(text: str, heading: str, comments: Mapping[tuple[str, str], list[str]], numbers: str) -> str:
    """Return MJCF text with comments: before each element (kind, name), on top, and before its custom `numbers`."""
    root = _tree(text)
    parents = {child: parent for parent in root.iter() for child in parent}
    for (kind, name), said in comments.items():
        section = root.find(_SECTIONS[kind])
        inside = section.iter() if section is not None else ()
        found = next(e for e in inside if e.tag in _TAGS.get(kind, (e.tag,)) and e is not section and e.get("name") == name)
        indent = "\n" + "  " * _depth(found, parents)
        for line in said:
            _insert_comment(parents[found], list(parents[found]).index(found), line, indent)
    if (custom := root.find("custom")) is not None and numbers:
        _insert_comment(root, list(root).index(custom), numbers, "\n  ")
    _insert_comment(root, 0, heading, "\n  ")
    return ET.tostring(root, encoding="unicode").replace(" />", "/>") + "\n"


def _insert_comment(parent: ET.Element, at: int, said: str, indent: str) -> None:
    comment = ET.Comment(f" {said.replace('--', '- -')} ")
    comment.tail = indent
    parent.insert(at, comment)


def _depth(element: ET.Element, parents: Mapping[ET.Element, ET.Element]) -> int:
    depth = 0
    while (above := parents.get(element)) is not None:
        element, depth = above, depth + 1
    return depth


def _tree(text: str) -> ET.Element:
    return ET.fromstring(text, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
