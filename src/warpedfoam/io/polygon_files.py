"""Polygons of PLY and OBJ files, kept as polygons (trimesh cuts them into triangles)."""

from __future__ import annotations

import re

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.errors import FileFormatError

#: Points, polygons, and how many of the first points are vertices of a foam (0: not told).
Polygons = tuple[Floats, list[list[int]], int]

#: A comment in the files of `write_ply` (from 0) and `write_obj` (from 1): which points are vertices.
_VERTICES = re.compile(r"vertices ([01]) to (\d{1,9}) are the foam's")

_KINDS = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
#: The end of a PLY header, on a line of its own, and the byte order mark of some editors.
_END = re.compile(rb"[\r\n]end_header[ \t]*(?:\r\n|\n|\r|$)")
_MARK = b"\xef\xbb\xbf"
_LISTS = ("vertex_indices", "vertex_index")


def obj_polygons(data: bytes) -> Polygons:
    """Points and polygons (numbered from 0) of an OBJ file; all but ``v`` and ``f`` is passed over.

    Raises
    ------
    FileFormatError
        If a line cannot be understood.
    """
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    lines = text_in(data).replace("\\\n", " ").splitlines()
    for number, line in enumerate(lines, start=1):
        words = line.split("#", 1)[0].split()
        try:
            if words[:1] == ["v"]:
                points.append([float(w) for w in words[1:4]])
                if len(words) < 4:
                    raise ValueError("a point needs three numbers")
            elif words[:1] == ["f"]:
                places = [int(w.split("/")[0]) for w in words[1:]]
                polygons.append([p - 1 if p > 0 else len(points) + p if p else -1 for p in places])
        except ValueError as fault:
            raise FileFormatError(f"line {number} cannot be understood ({fault})") from None
    return np.array(points, dtype=np.float64).reshape(-1, 3), polygons, _told(text_in(data))


def _told(text: str) -> int:
    found = _VERTICES.search(text)
    return int(found[2]) + 1 - int(found[1]) if found else 0


def ply_polygons(data: bytes) -> Polygons:
    """Points and polygons of a PLY file, ASCII or binary.

    Raises
    ------
    FileFormatError
        If the header or the body cannot be understood, or the file ends too early.
    """
    data = data.removeprefix(_MARK)
    end = _END.search(data)
    if end is None or not data.startswith(b"ply"):
        raise FileFormatError("it is no PLY file, or its header does not end")
    head, body = data[: end.start()], data[end.end() :]
    form, elements = _header(text_in(head))
    if form == "ascii":
        words = text_in(body).split()
        if len(words) > 0 and elements:
            return *_walk_words(words, elements), _told(text_in(head))
        raise FileFormatError("it has no body")
    return *_walk_bytes(body, elements, "<" if form == "binary_little_endian" else ">"), _told(text_in(head))


Property = tuple[str, str, str | None]
Element = tuple[str, int, list[Property]]


def _header(text: str) -> tuple[str, list[Element]]:
    """The format; elements with their counts and properties (name, type, type of the list's count)."""
    form = ""
    elements: list[Element] = []
    for line in text.splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                form = words[1]
            elif words[0] == "element":
                count = int(words[2])
                if count < 0:
                    raise ValueError(f"{count} elements")
                elements.append((words[1], count, []))
            elif words[0] == "property" and words[1] == "list":
                if _KINDS[words[2]].startswith("f"):
                    raise ValueError("a list's length is no whole number")
                elements[-1][2].append((words[4], _KINDS[words[3]], _KINDS[words[2]]))
            elif words[0] == "property":
                elements[-1][2].append((words[2], _KINDS[words[1]], None))
            else:
                raise ValueError(f"unknown word {words[0]!r}")
        except (IndexError, KeyError, ValueError) as fault:
            raise FileFormatError(f"its header has a line {line!r} ({fault})") from None
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise FileFormatError(f"its format {form!r} is not known")
    return form, elements


def _walk_words(words: list[str], elements: list[Element]) -> tuple[Floats, list[list[int]]]:
    points, polygons = np.zeros((0, 3)), [[0][:0]]
    polygons.clear()
    at = 0
    for name, count, properties in elements:
        plain = all(counter is None for _, _, counter in properties)
        # each value takes a word at least: a count beyond that is no number of things to make room for
        if count * len(properties) > len(words) - at:
            raise FileFormatError(f"it ends before its {count} elements {name!r}")
        try:
            if name == "vertex" and plain:
                table = np.array(words[at : at + count * len(properties)], dtype=np.float64)
                table = table.reshape(count, len(properties))
                points = table[:, _axes(properties)]
                at += table.size
            elif plain:
                at += count * len(properties)
            else:
                for _ in range(count):
                    for label, _, counter in properties:
                        size = int(words[at]) if counter else 1
                        at += 1 if counter else 0
                        if size < 0 or at + size > len(words):
                            raise FileFormatError(f"it ends before its {count} elements {name!r}")
                        if counter and name == "face" and label in _LISTS:
                            polygons.append([int(w) for w in words[at : at + size]])
                        at += size
        except (ValueError, IndexError, OverflowError) as fault:
            raise FileFormatError(f"its elements {name!r} cannot be understood ({fault})") from None
    return points, polygons


def _walk_bytes(body: bytes, elements: list[Element], order: str) -> tuple[Floats, list[list[int]]]:
    points = np.zeros((0, 3))
    polygons: list[list[int]] = []
    at = 0
    for name, count, properties in elements:
        plain = all(counter is None for _, _, counter in properties)
        if plain:
            row = np.dtype([(f"p{k}", order + kind) for k, (_, kind, _) in enumerate(properties)])
            if not properties or count * row.itemsize > len(body) - at:
                raise FileFormatError(f"it ends before its {count} elements {name!r}")
            if name == "vertex":
                table = np.frombuffer(body, row, count, at)
                points = np.stack([table[f"p{k}"] for k in _axes(properties)], axis=1).astype(np.float64)
            at += count * row.itemsize
            continue
        for _ in range(count):
            for label, kind, counter in properties:
                size = 1
                if counter:
                    size = int(_numbers(body, order + counter, 1, at, name)[0])
                    at += np.dtype(counter).itemsize
                values = _numbers(body, order + kind, size, at, name)
                if counter and name == "face" and label in _LISTS:
                    polygons.append([int(v) for v in values])
                at += values.nbytes
    return points, polygons


def _numbers(body: bytes, kind: str, count: int, at: int, name: str) -> np.ndarray:
    if count < 0 or count * np.dtype(kind).itemsize > len(body) - at:
        raise FileFormatError(f"it ends in the middle of its elements {name!r}")
    return np.frombuffer(body, kind, count, at)


def _axes(properties: list[Property]) -> list[int]:
    names = [label for label, _, _ in properties]
    if any(names.count(axis) != 1 for axis in "xyz"):
        raise FileFormatError("its vertices need x, y and z, each once")
    return [names.index(axis) for axis in "xyz"]


def text_in(data: bytes) -> str:
    """Text in whatever extension of ASCII: numbers and keywords are ASCII, comments are passed over."""
    if b"\0\0" in data or data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise FileFormatError("it is no text where text is expected")
    return data.removeprefix(_MARK).decode("utf-8", errors="replace").replace("\r\n", "\n")
