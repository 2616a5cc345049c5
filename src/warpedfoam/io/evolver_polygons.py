"""Bubbles of the Surface Evolver's string models as polygons: what `write_fe` wrote, moved or not."""

from __future__ import annotations

import re

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.errors import FileFormatError
from warpedfoam.io.evolver_dump import element_rows
from warpedfoam.io.polygon_files import Polygons, text_in
from warpedfoam.surfaces.rim import Rim

_QUANTITY = re.compile(r"^QUANTITY\s+(bubble_\d{1,18})\b", re.MULTILINE | re.IGNORECASE)
_SECTION = re.compile(r"^(vertices|edges|faces|bodies|read)\b.*$", re.MULTILINE | re.IGNORECASE)
_BESIDE = re.compile(r"\b(bubble_\d{1,18})\b\s*(-?)")
#: Polygon round a bubble: runs of points, which walls join.
_Runs = list[list[int]]


def evolver_polygons(data: bytes, rim: Rim | None) -> Polygons:
    """Points and polygons of a ``.fe`` or ``.dmp`` file in the string model, as `write_fe` names things.

    Polygon i is the bubble of the i-th quantity; what has none comes where `write_fe` says, if it is a disk.
    Polygons get a point in the middle of every wall.

    Raises
    ------
    FileFormatError
        If it is no such file, or is damaged.
    """
    text = text_in(data)
    if re.search(r"^STRING\b", text, re.MULTILINE | re.IGNORECASE) is None:
        raise FileFormatError("it is no string model of the Surface Evolver: only such hold polygons")
    vertices, rest, outside = (_parameter(text, name) for name in ("vertices", "rest", "exterior"))
    sections = {m.group(1).lower(): m for m in _SECTION.finditer(text)}
    for name in ("vertices", "edges", "read"):
        if name not in sections:
            raise FileFormatError(f"it has no section {name!r}: it is damaged or cut off")
    first, middle = sections["vertices"], sections["edges"]
    last = min((m for k, m in sections.items() if k not in ("vertices", "edges")), key=lambda m: m.start())
    if not first.start() < middle.start() < last.start():
        raise FileFormatError("its sections are out of order")
    numbers, points, _ = element_rows(text[first.end() : middle.start()], 3, "vertex")
    _, ends, words = element_rows(text[middle.end() : last.start()], 2, "edge")
    order = np.argsort(numbers)
    numbers, points = numbers[order], points[order]
    place = np.minimum(np.searchsorted(numbers, ends), len(numbers) - 1)
    if (numbers[place] != ends).any():
        raise FileFormatError("an edge ends in a vertex that is not there")
    names = list(dict.fromkeys(_QUANTITY.findall(text[: first.start()])))
    if rest > len(names) or not names:
        raise FileFormatError(f"it holds {len(names)} bubbles with quantities, but one at place {rest}")
    names.insert(rest, "")
    left, right = _sides(words, {name: k for k, name in enumerate(names)}, rest)
    polygons, more = [], [points]
    count = len(points)
    for k, runs in enumerate(_outlines(place, left, right, len(names))):
        if k == rest and outside:
            continue
        ring, walls = _joined(runs, points, rim, k)
        polygons.append([p if p >= 0 else count - 1 - p for p in ring])
        more.append(walls)
        count += len(walls)
    if not 0 < vertices <= len(points):
        raise FileFormatError(f"{vertices} of its {len(points)} points are vertices of a foam: it is damaged")
    return np.concatenate(more), polygons, vertices


def _parameter(text: str, name: str) -> int:
    found = re.search(rf"^PARAMETER\s+foam_{name}\s*=\s*(\d{{1,9}})\s*$", text, re.MULTILINE | re.IGNORECASE)
    if found is None:
        raise FileFormatError(f"it has no parameter foam_{name}: it is no foam of write_fe's")
    return int(found[1])


def _sides(words: list[str], places: dict[str, int], rest: int) -> tuple[Ints, Ints]:
    """The bubbles left and right of each edge, by its quantities and their signs."""
    out = np.full((2, len(words)), rest, dtype=np.int64)
    for edge, line in enumerate(words):
        found = _BESIDE.findall(line)
        for name, sign in found:
            if name not in places:
                raise FileFormatError(f"an edge belongs to {name}, which is no quantity of the file")
            out[int(bool(sign)), edge] = places[name]
        if len({sign for _, sign in found}) != len(found):
            raise FileFormatError("an edge has two bubbles on one side")
    if (out[0] == out[1]).any():
        raise FileFormatError("an edge has the same bubble on both sides")
    return out[0], out[1]


def _outlines(ends: Ints, left: Ints, right: Ints, count: int) -> list[_Runs]:
    """For each bubble the chains of points round it, counter-clockwise; a closed one ends where it starts."""
    onward: list[dict[int, int]] = [{} for _ in range(count)]
    for (a, b), one, other in zip(ends.tolist(), left.tolist(), right.tolist(), strict=True):
        for bubble, start, end in ((one, a, b), (other, b, a)):
            if start in onward[bubble]:
                raise FileFormatError("a bubble meets one vertex twice: the file is damaged or no foam")
            onward[bubble][start] = end
    out: list[_Runs] = []
    for steps in onward:
        heads = set(steps.values())
        if len(heads) != len(steps):
            raise FileFormatError("a bubble meets one vertex twice: the file is damaged or no foam")
        runs: _Runs = []
        # chains that start at the rim first; what is left are rings
        for start in [p for p in steps if p not in heads] + list(steps):
            if start not in steps:
                continue
            run = [start]
            while run[-1] in steps:
                run.append(steps.pop(run[-1]))
            runs.append(run)
        out.append(runs)
    return out


def _joined(runs: _Runs, points: Floats, rim: Rim | None, bubble: int) -> tuple[list[int], Floats]:
    """One ring of places, −1 − k for the k-th of the points in the middle of walls, which follow."""
    rings = [run for run in runs if run[0] == run[-1]]
    none = np.zeros((0, 3))
    if rings and len(runs) == 1:
        return rings[0][:-1], none
    if rings or not runs:
        raise FileFormatError(f"bubble {bubble} is no disk: its films do not make one ring")
    if rim is None:
        raise FileFormatError(
            f"the films round bubble {bubble} do not close, and the cell's surface has no rim"
        )
    loop, start = rim.locate(points[[run[0] for run in runs]])
    other, end = rim.locate(points[[run[-1] for run in runs]])
    ring, at = list(runs[0]), 0
    walls: list[Floats] = []
    for _ in runs:
        length = rim.lengths[other[at]]
        ahead = np.where(loop == other[at], np.mod(start - end[at], length), np.inf)
        following = int(ahead.argmin())
        if not np.isfinite(ahead[following]):
            raise FileFormatError(f"the films round bubble {bubble} end on a rim where none starts")
        ring.append(-1 - len(walls))
        walls.append(rim.at(other[at : at + 1], end[at : at + 1] + 0.5 * ahead[following])[0])
        at = following
        if at == 0:
            break
        ring += runs[at]
    if len(walls) != len(runs):
        raise FileFormatError(f"bubble {bubble} is no disk: its films and walls do not make one ring")
    return ring, np.array(walls)
