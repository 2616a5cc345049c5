"""What an ensemble measures of each foam: observables by name, each a number or several."""

from __future__ import annotations

import difflib
import hashlib
import importlib
import math
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.analysis import (
    bond_order,
    charge_profile,
    defects,
    equilibrium_report,
    foam_statistics,
    honeycomb_bound,
    side_distribution,
)
from warpedfoam.analysis.charge_curvature import band_curvatures
from warpedfoam.arrays import Floats, as_floats, as_integer
from warpedfoam.cell import HeleShawCell
from warpedfoam.foam import Foam
from warpedfoam.relax.result import Relaxation
from warpedfoam.surfaces import Sphere, Torus

#: A value of the table; None leaves its place blank.
Value = bool | int | float | str | None
Values = dict[str, Value]

_CIRCLE = 180.0 / np.pi


@dataclass(frozen=True, eq=False)
class Measured:
    """A relaxed foam, with what has been measured of it so far.

    Attributes
    ----------
    relaxed : Relaxation
    energy_start : float
        Energy of the foam before relaxation.
    """

    relaxed: Relaxation
    energy_start: float
    known: dict[str, Values] = field(default_factory=dict)

    @property
    def foam(self) -> Foam:
        """The relaxed foam."""
        return self.relaxed.foam


def energy_over_honeycomb(foam: Foam) -> float:
    """E / (γ d L), L the honeycomb bound of the bubbles' mean areas through the gap, V_i / d.

    Examples
    --------
    >>> from warpedfoam import FlatTorus, HeleShawCell, relax, voronoi_foam
    >>> cell = HeleShawCell(FlatTorus(4.0, 2.0 * 3.0**0.5), gap=0.1)
    >>> foam = relax(voronoi_foam(cell, n_bubbles=16, seeds="lattice")).foam
    >>> round(energy_over_honeycomb(foam), 3) >= 1.0
    True
    """
    gap = foam.cell.parallel_gap("energy over the honeycomb's")
    areas = foam.bubble_volumes[foam.network.bubble_euler == 1] / gap
    return foam.energy / (foam.tension * gap * honeycomb_bound(areas))


def _length_over_honeycomb(foam: Foam) -> float:
    return float(foam.film_lengths.sum()) / honeycomb_bound(foam.bubble_areas[foam.network.bubble_euler == 1])


def _charges(foam: Foam) -> Values:
    values, counts = np.unique(foam.network.charges[foam.network.bubble_euler == 1], return_counts=True)
    return dict(zip(map(str, values.tolist()), counts.tolist(), strict=True))


def _sides(foam: Foam) -> Values:
    found = side_distribution(foam)
    return dict(zip(map(str, found.sides.tolist()), found.counts.tolist(), strict=True))


def _statistics(foam: Foam) -> Values:
    found = foam_statistics(foam)
    names = ("mean_sides", "mu2", "aboav", "lewis", "area_deviation", "pressure_deviation")
    return {name: getattr(found, name) for name in names}


def _equilibrium(foam: Foam) -> Values:
    found = equilibrium_report(foam)
    return {
        "angle_error": found.angle_error,
        "curvature_spread": float(found.curvature_spread.max()),
        "laplace_error": found.laplace_error,
        "identity_error": found.identity_error,
    }


#: Observables of one number, by name.
SINGLE: Mapping[str, Callable[[Measured], Value]] = {
    "energy": lambda m: m.relaxed.energy,
    "energy_start": lambda m: m.energy_start,
    "energy_over_honeycomb": lambda m: energy_over_honeycomb(m.foam),
    "length": lambda m: float(m.foam.film_lengths.sum()),
    "length_over_honeycomb": lambda m: _length_over_honeycomb(m.foam),
    "mu2": lambda m: side_distribution(m.foam).mu2,
    "n_t1": lambda m: m.relaxed.n_t1,
    "iterations": lambda m: m.relaxed.iterations,
    "residual": lambda m: m.relaxed.residual,
    "volume_error": lambda m: m.relaxed.volume_error,
    "is_minimum": lambda m: m.relaxed.is_minimum,
    "n_films": lambda m: m.foam.network.n_films,
    "sum_of_charges": lambda m: side_distribution(m.foam).total_charge,
    "euler_characteristic": lambda m: m.foam.network.euler_characteristic,
    "mean_order": lambda m: bond_order(m.foam).mean_magnitude,
}
#: Observables of several numbers; ``name.part`` asks for one of them.
GROUPS: Mapping[str, Callable[[Foam], Values]] = {
    "charges": _charges,
    "sides": _sides,
    "defects": lambda foam: _flat(defects(foam).summary),
    "statistics": _statistics,
    "equilibrium": _equilibrium,
}
#: Parts that are counted by a whole number in their name: absent means none.
COUNTED = re.compile(r"(charges|sides|defects\.charges)\.-?\d+")


def _tube_angle(cell: HeleShawCell, x: Floats) -> Floats:
    surface = cell.surface
    if not isinstance(surface, Torus):
        raise ValueError(f"coordinate tube_angle needs a torus, got a {type(surface).__name__}")
    across = np.hypot(x[:, 0], x[:, 1]) - surface.major_radius
    return np.asarray(_CIRCLE * np.abs(np.arctan2(x[:, 2], across)))


#: Coordinates of charge profiles; angles in degrees.
COORDINATES: Mapping[str, Callable[[HeleShawCell, Floats], Floats]] = {
    "x": lambda _, x: x[:, 0],
    "y": lambda _, x: x[:, 1],
    "z": lambda _, x: x[:, 2],
    "axis_distance": lambda _, x: np.hypot(x[:, 0], x[:, 1]),
    "polar_angle": lambda _, x: np.asarray(_CIRCLE * np.arctan2(np.hypot(x[:, 0], x[:, 1]), x[:, 2])),
    "tube_angle": _tube_angle,
}


@dataclass(frozen=True)
class Observable:
    """An observable of a study.

    Attributes
    ----------
    name : str
        Start of its columns' names.
    base : str
        What is evaluated: a name of `SINGLE` or `GROUPS`, ``"charge_profile"``, or ``"module:function"``.
    part : str
        The one part of a group that is asked for; empty for all.
    options : tuple of (str, value) pairs
        Of a charge profile.
    mark : str
        Stands for the content of the file that a function of the user's comes from.
    """

    name: str
    base: str
    part: str = ""
    options: tuple[tuple[str, Any], ...] = ()
    mark: str = field(default="", repr=False)

    def evaluate(self, measured: Measured) -> Values:
        """Measure the foam; columns of the table by name.

        Raises
        ------
        ValueError, TypeError
            If a value is not finite or none that a table can hold.
        """
        known = measured.known
        place = repr((self.base, self.options))
        if place not in known:
            known[place] = self._evaluate(measured)
        values = known[place]
        if not self.part:
            return {f"{self.name}.{key}" if key else self.name: value for key, value in values.items()}
        if self.part in values:
            return {self.name: values[self.part]}
        below = {key: value for key, value in values.items() if key.startswith(self.part + ".")}
        if below or not COUNTED.fullmatch(self.name):
            return {f"{self.base}.{key}": value for key, value in below.items()}
        return {self.name: 0}

    def _evaluate(self, measured: Measured) -> Values:
        if self.base in SINGLE:
            return {"": _plain(SINGLE[self.base](measured), self.base)}
        if self.base in GROUPS:
            found: Any = GROUPS[self.base](measured.foam)
        elif self.base == "charge_profile":
            found = _profile(measured.foam, **dict(self.options))
        else:
            found = imported(self.base)(measured.foam)
            if not isinstance(found, Mapping):
                found = {"": found}
        return {key: _plain(value, f"{self.base} {key}".strip()) for key, value in _flat(found).items()}


def observable_from(value: Any, name: str) -> Observable:
    """Read an observable of a study: a name, or a table with a kind.

    Parameters
    ----------
    value : str or mapping
        A name of `SINGLE` or `GROUPS`, ``group.part``, ``"module:function"``, or
        ``{kind = "charge_profile", coordinate = …, edges = […]}``.
    name : str
        What to call it in messages.

    Raises
    ------
    TypeError, ValueError
        If there is no such observable; near names are told.

    Examples
    --------
    >>> observable_from("defects.clusters.scar", "observables[0]")
    Observable(name='defects.clusters.scar', base='defects', part='clusters.scar', options=())
    >>> observable_from("enregy", "observables[0]")
    Traceback (most recent call last):
    ValueError: observables[0]: unknown observable 'enregy'; did you mean energy?
    """
    if isinstance(value, Mapping):
        return _profile_from(value, name)
    if not isinstance(value, str) or not value:
        raise TypeError(f"{name} must be the name of an observable or a table with a kind, got {value!r}")
    if ":" in value:
        _require_importable(value, name)
        return Observable(value.rpartition(":")[2], value, mark=_file_mark(value))
    base, _, part = value.partition(".")
    if value in SINGLE or value in GROUPS:
        return Observable(value, value)
    if base in GROUPS and part and (COUNTED.fullmatch(value) or part in _parts(base)):
        return Observable(value, base, part)
    known = [*SINGLE, *GROUPS]
    if base in GROUPS:
        known = [f"{base}.{key}" for key in _parts(base)]
    near = difflib.get_close_matches(value, known, n=2)
    hint = f"did you mean {' or '.join(near)}?" if near else f"known are {', '.join(known)}"
    raise ValueError(f"{name}: unknown observable {value!r}; {hint}")


def imported(text: str) -> Callable[..., Any]:
    """Return the function that ``"module:function"`` names.

    Raises
    ------
    ValueError
        If it cannot be imported or is no function.
    """
    module, _, function = text.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except Exception as fault:  # the module is the user's: it may raise anything
        raise ValueError(f"{text} cannot be imported: {type(fault).__name__}: {fault}") from None
    if not callable(found):
        raise ValueError(f"{text} is a {type(found).__name__}, not a function")
    return found  # type: ignore[no-any-return]


def look_in(folder: str) -> None:
    """Let modules of the user's be found in ``folder`` too, after all others."""
    if folder and folder not in sys.path:
        sys.path.append(folder)


def _require_importable(text: str, name: str) -> None:
    module, _, function = text.partition(":")
    if not module or not function.isidentifier():
        raise ValueError(f"{name} must be written as module:function, got {text!r}")
    try:
        imported(text)
    except ValueError as fault:
        raise ValueError(f"{name}: {fault}") from None


def _file_mark(text: str) -> str:
    """SHA-256 of the file of ``"module:function"``: results of a function that was edited are another's."""
    file = getattr(sys.modules[text.partition(":")[0]], "__file__", None)
    if not file or not Path(file).is_file():
        return ""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16]


@lru_cache(maxsize=8)
def _parts(group: str) -> tuple[str, ...]:
    """Names of the parts of a group, and of groups inside it, from the foam of four triangles."""
    points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    names = list(GROUPS[group](Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)))
    return tuple(dict.fromkeys([*names, *(n.partition(".")[0] for n in names if "." in n)]))


def _profile_from(value: Mapping[str, Any], name: str) -> Observable:
    options = dict(value)
    kind = options.pop("kind", None)
    if kind != "charge_profile":
        raise ValueError(f"{name}.kind must be 'charge_profile', got {kind!r}")
    unknown = sorted(options.keys() - {"name", "coordinate", "edges", "n_nodes"})
    if unknown:
        raise ValueError(f"{name}: unknown option {unknown[0]}; options are name, coordinate, edges, n_nodes")
    title = options.pop("name", "charge_profile")
    if not isinstance(title, str) or not re.fullmatch(r"[A-Za-z_]\w*", title):
        raise ValueError(f"{name}.name must be a word to start its columns with, got {title!r}")
    coordinate = options.get("coordinate")
    if isinstance(coordinate, str) and ":" in coordinate:
        _require_importable(coordinate, f"{name}.coordinate")
    elif coordinate not in COORDINATES:
        raise ValueError(
            f"{name}.coordinate must be one of {', '.join(COORDINATES)} or module:function, "
            f"got {coordinate!r}"
        )
    edges = as_floats(options.get("edges", []), f"{name}.edges", (None,))
    if len(edges) < 2 or (np.diff(edges) <= 0.0).any():
        raise ValueError(f"{name}.edges must hold at least two numbers, ascending")
    nodes = as_integer(options.get("n_nodes", 20_000), f"{name}.n_nodes", minimum=0)
    return Observable(
        title,
        "charge_profile",
        options=(("coordinate", coordinate), ("edges", tuple(edges.tolist())), ("n_nodes", nodes)),
        mark=_file_mark(str(coordinate)) if ":" in str(coordinate) else "",
    )


def _profile(foam: Foam, coordinate: str, edges: tuple[float, ...], n_nodes: int) -> Values:
    """Bubbles, charge and curvature of each band, and the curvature of the band itself."""
    cell = foam.cell
    found = charge_profile(foam, _coordinate(coordinate, cell), edges, n_nodes=0)
    columns: dict[str, list[Value]] = {
        "bubbles": np.round(found.bubbles).astype(int).tolist(),
        "charge": found.charges[0].tolist(),
        "curvature": found.curvature.tolist(),
    }
    if n_nodes:
        columns["region_curvature"] = list(_region(cell, coordinate, edges, n_nodes))
    return {f"{name}.{k}": value for name, values in columns.items() for k, value in enumerate(values)}


@lru_cache(maxsize=16)
def _region(cell: HeleShawCell, coordinate: str, edges: tuple[float, ...], n_nodes: int) -> tuple[float, ...]:
    # the same for all foams in a cell
    curvatures = band_curvatures(cell.surface, _coordinate(coordinate, cell), edges, n_nodes=n_nodes)
    return tuple((3.0 / np.pi * curvatures).tolist())


def _coordinate(name: str, cell: HeleShawCell) -> Callable[[Floats], Any]:
    if name in COORDINATES:
        return lambda x: COORDINATES[name](cell, x)
    return imported(name)


def _flat(values: Mapping[str, Any]) -> dict[str, Any]:
    """Nested mappings as one, keys joined by dots."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            out |= {f"{key}.{inner}": item for inner, item in _flat(value).items()}
        else:
            out[str(key)] = value
    return out


def _plain(value: Any, name: str) -> Value:
    """Python's own number, text or None; nothing that is not finite."""
    if isinstance(value, (np.generic, np.ndarray)) and value.ndim == 0:
        value = value.item()
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, int):
        if not -(2**63) <= value < 2**63:
            raise ValueError(f"{name} is {value}, too large for a column of integers")
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{name} is {value}; return None where there is no value")
        return value
    raise TypeError(f"{name} must be a number, a text or None, got {type(value).__name__}")
