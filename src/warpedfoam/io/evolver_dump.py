"""Results of the Surface Evolver: its dump files."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints, as_instance, frozen
from warpedfoam.errors import FileFormatError
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, as_path
from warpedfoam.io.evolver_forms import rest_of
from warpedfoam.io.reading import brief, text_of

_FLOAT = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_ENERGY = re.compile(rf"^// Total energy:\s*({_FLOAT})\s*$", re.MULTILINE)
_QUANTITY = re.compile(
    rf"^QUANTITY\s+(\w+)\s+(?:FIXED|CONSERVED)\s*=\s*({_FLOAT})\s+lagrange_multiplier\s+({_FLOAT})",
    re.MULTILINE | re.IGNORECASE,
)
_SECTION = re.compile(r"^(vertices|edges|faces|bodies|read)\b.*$", re.MULTILINE)
_BODY = re.compile(
    rf"^\s*(\d+)\s[^/\n]*?(?:\\\n[^/\n]*?)*?volume\s+({_FLOAT})[^\n]*?lagrange_multiplier\s+({_FLOAT})",
    re.MULTILINE,
)


@dataclass(frozen=True, eq=False)
class EvolverDump:
    """What a dump file says of the surface.

    Attributes
    ----------
    energy : float
        Total energy.
    points : (n, 3) array
        Vertices, in the order of the file.
    edges : (m, 2) array of int
        Places of the edges' ends in ``points``.
    targets, pressures : dict of str to float
        Of every volume that is held: a fixed quantity by its name, a body as ``body_<number>``.
    """

    energy: float
    points: Floats
    edges: Ints
    targets: dict[str, float]
    pressures: dict[str, float]

    def bubble_pressures(self, foam: Foam) -> Floats:
        """Pressures (n_bubbles,) of the bubbles of a foam that `write_fe` wrote.

        Their mean is zero, or an exterior's pressure is.

        Raises
        ------
        TypeError
            If ``foam`` is not a Foam.
        ValueError
            If the dump is of other bubbles.
        """
        as_instance(foam, "foam", Foam)
        rest = rest_of(foam)
        names = [f"bubble_{i}" for i in np.delete(foam.bubble_ids, rest).tolist()]
        missing = [name for name in names if name not in self.pressures]
        if missing or len(self.pressures) != len(names):
            raise ValueError(
                f"foam has {foam.n_bubbles} bubbles, but the dump holds {len(self.pressures)} volumes"
                + (f" and no {missing[0]}" if missing else "")
            )
        values = np.insert(np.array([self.pressures[name] for name in names]), rest, 0.0)
        out: Floats = values if foam.exterior is not None else values - values.mean()
        return out


def read_dmp(path: PathLike) -> EvolverDump:
    r"""Read a dump file of the Surface Evolver (its command ``dump``; 2.70, three dimensions).

    Parameters
    ----------
    path : str or path

    Returns
    -------
    EvolverDump

    Raises
    ------
    TypeError
        If ``path`` is no path.
    FileNotFoundError
        If there is no such file.
    FileFormatError
        If the file is no dump or is damaged.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name) / "line.dmp"
    >>> lines = ["// Total energy: 1.0", "STRING", "vertices", " 1  0 0 0", " 2  1 0 0", "edges", " 1  1 2"]
    >>> _ = path.write_text("\n".join([*lines, "faces", "bodies", "read", ""]))
    >>> read_dmp(path).edges.tolist()
    [[0, 1]]
    >>> folder.cleanup()
    """
    source = as_path(path)
    text = text_of(source)
    try:
        return _dump(text)
    except FileFormatError as fault:
        raise FileFormatError(f"cannot read {source}: {brief(fault)}") from None


def _dump(text: str) -> EvolverDump:
    energy = _ENERGY.search(text)
    if energy is None:
        raise FileFormatError("it has no total energy: it is no dump of the Surface Evolver")
    sections = {m.group(1): m for m in _SECTION.finditer(text)}
    for name in ("vertices", "edges", "faces", "bodies", "read"):
        if name not in sections:
            raise FileFormatError(f"it has no section {name!r}: it is damaged or cut off")
    starts = [sections[name].start() for name in ("vertices", "edges", "faces", "bodies", "read")]
    if starts != sorted(starts):
        raise FileFormatError("its sections are out of order")
    numbers, points, _ = element_rows(text[sections["vertices"].end() : starts[1]], 3, "vertex")
    _, ends, _ = element_rows(text[sections["edges"].end() : starts[2]], 2, "edge")
    place = np.argsort(numbers)
    found = np.minimum(np.searchsorted(numbers[place], ends), len(numbers) - 1)
    edges = place[found]
    if (numbers[edges] != ends).any():
        raise FileFormatError("an edge ends in a vertex that is not there")
    targets: dict[str, float] = {}
    pressures: dict[str, float] = {}
    for name, target, pressure in _QUANTITY.findall(text[: starts[0]]):
        targets[name], pressures[name] = _finite(target), _finite(pressure)
    for number, target, pressure in _BODY.findall(text[sections["bodies"].end() : starts[4]]):
        targets[f"body_{number}"], pressures[f"body_{number}"] = _finite(target), _finite(pressure)
    return EvolverDump(_finite(energy.group(1)), frozen(points), frozen(edges), targets, pressures)


def element_rows(section: str, count: int, what: str) -> tuple[Ints, Floats, list[str]]:
    """Numbers of the elements, all different, the ``count`` values after each, and the words after these.

    Raises
    ------
    FileFormatError
        If a line is none of an element, or there is none.
    """
    numbers, values, words_after = [], [], []
    for line in section.replace("\\\n", " ").splitlines():
        words = line.split()
        if not words or words[0].startswith(("/", "*")) or not words[0].isdigit():
            continue  # attributes that run over, comments
        try:
            row = [float(w) for w in words[1 : count + 1]]
        except ValueError:
            raise FileFormatError(f"{what} {words[0]} is not followed by {count} numbers") from None
        if len(row) != count or not all(map(math.isfinite, row)):
            raise FileFormatError(f"{what} {words[0]} is not followed by {count} numbers")
        numbers.append(int(words[0]))
        values.append(row)
        words_after.append(" ".join(words[count + 1 :]))
    if not numbers:
        raise FileFormatError(f"it has no {what}")
    if max(numbers) > 2**62 or len(set(numbers)) != len(numbers):
        raise FileFormatError(f"its {what} numbers are not all different")
    return np.array(numbers, dtype=np.int64), np.array(values), words_after


def _finite(word: str) -> float:
    value = float(word)
    if not math.isfinite(value):
        raise FileFormatError(f"it holds the number {word}")
    return value
