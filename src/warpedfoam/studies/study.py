"""`Study`: what an ensemble computes: a grid of options, seeds, and observables."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from warpedfoam.arrays import as_flag, as_integer, as_number
from warpedfoam.cell import HeleShawCell
from warpedfoam.sizes import SIZES
from warpedfoam.studies.observables import Observable, look_in, observable_from
from warpedfoam.studies.options import Options, Places, option_names, options_from, read_values

#: Sections of options that a study shares with the main job.
SHARED = ("surface", "cell", "foam", "relax")
NAMES = ("seed", "repeats", "same_seeds", "states", "observables", *SHARED, "grid", "cases")
#: Sizes that a study knows besides those of `SIZES`, by kind of surface.
DERIVED: Mapping[str, tuple[str, ...]] = {"torus": ("aspect_ratio", "area"), "sphere": ("area",)}
DEFAULT_OBSERVABLES = ("energy", "energy_over_honeycomb", "mu2", "n_t1", "residual", "iterations", "charges")
#: Most runs of a study: beyond, a typing error is likelier than patience.
MOST_RUNS = 1_000_000

Table = Mapping[str, Any]


@dataclass(frozen=True)
class Run:
    """One member of an ensemble.

    Attributes
    ----------
    number : int
        Its row in the table.
    repeat : int
    seed : int
        Of the foam: `warpedfoam.voronoi_foam` with these options and this seed gives the same foam.
    parameters : mapping
        What varies over the study, by dotted name; its own values.
    values : mapping
        All options, nested as in a TOML file of the main job.
    key : str
        Stands for options, seed and observables: the same key, the same results.
    """

    number: int
    repeat: int
    seed: int
    parameters: Table
    values: Table
    key: str


@dataclass(frozen=True)
class Study:
    """A grid of options, how often each point is repeated, and what is measured.

    Runs are numbered with ``repeats`` varying fastest, then the last axis of the grid; cases are slowest.
    Seeds come from ``numpy.random.SeedSequence(seed)``, spawned by repeat and by the content of the
    point (surface, gap and foam), not by its place, so that a grid may grow without changing the foams
    that are there.

    Parameters
    ----------
    seed : int, optional
        Root of all seeds.
    repeats : int, optional
        Runs at each point of the grid, each with a seed of its own.
    same_seeds : bool, optional
        Give every point the same seeds: differences between points then scatter less where foams differ
        little.
    states : bool, optional
        Keep every foam (``states/KEY.npz``).
    observables : sequence, optional
        See `warpedfoam.studies.observables.observable_from`.
    surface, cell, foam, relax : mapping, optional
        As in a TOML file of the main job. A torus may have ``aspect_ratio`` (R/r) and ``area`` too, any two
        of four sizes; a sphere ``area``. ``solver`` is ``"superlu"`` unless told otherwise, so that
        the results do not depend on what is installed.
    grid : mapping, optional
        Axes: lists of values, by dotted or nested name (``{"foam": {"n_bubbles": [50, 100]}}``), or
        ``"seed"``: given seeds instead of repeats.
    cases : sequence of mappings, optional
        Options that go together, nested or dotted, such as one surface each; the grid is run for every case.
    source : str, optional
        Where all this comes from, for messages.
    folder : str, optional
        Where modules of ``"module:function"`` observables are looked for besides the usual places.

    Raises
    ------
    ValueError
        Unknown names (near ones are told), values of the wrong type or range, sizes that contradict each
        other at a point of the grid, two points that are one.

    Examples
    --------
    >>> study = Study(
    ...     repeats=2,
    ...     surface={"kind": "torus", "area": 400.0, "aspect_ratio": 3.0},
    ...     foam={"n_bubbles": 80},
    ...     grid={"surface.aspect_ratio": [1.5, 3.0], "foam.volumes": [0.0, 0.3]},
    ... )
    >>> len(study.runs), study.runs[2].parameters["foam.volumes"], study.runs[2].repeat
    (8, 0.3, 0)
    """

    seed: int = 0
    repeats: int = 1
    same_seeds: bool = False
    states: bool = True
    observables: tuple[Any, ...] = DEFAULT_OBSERVABLES
    surface: Table = field(default_factory=dict)
    cell: Table = field(default_factory=dict)
    foam: Table = field(default_factory=dict)
    relax: Table = field(default_factory=dict)
    grid: Table = field(default_factory=dict)
    cases: tuple[Table, ...] = ()
    source: str = "study"
    folder: str = ""

    def __post_init__(self) -> None:
        places = Places(self.source, {})
        set_ = object.__setattr__
        for name, reader in (
            ("seed", lambda v, n: as_integer(v, n, minimum=0)),
            ("repeats", lambda v, n: as_integer(v, n, minimum=1)),
            ("same_seeds", as_flag),
            ("states", as_flag),
        ):
            set_(self, name, places.read(name, getattr(self, name), reader))
        for name in SHARED:
            table = getattr(self, name)
            if not isinstance(table, Mapping):
                raise ValueError(f"{self.source}: {name} must be a section, [{name}], got {table!r}")
            set_(self, name, MappingProxyType(dict(table)))
        for name in ("observables", "cases"):
            if not isinstance(getattr(self, name), (list, tuple)):
                raise ValueError(f"{self.source}: {name} must be a list, got {getattr(self, name)!r}")
            set_(self, name, tuple(getattr(self, name)))
        if not self.observables:
            raise ValueError(f"{self.source}: observables must name at least one")
        set_(self, "grid", MappingProxyType(dict(_axes(self.grid, places))))
        set_(self, "cases", tuple(MappingProxyType(_case(c, k, places)) for k, c in enumerate(self.cases)))
        _ = self.measures
        _ = self.runs

    @cached_property
    def measures(self) -> tuple[Observable, ...]:
        """The observables, read."""
        look_in(self.folder)
        places = Places(self.source, {})
        found = []
        for k, value in enumerate(self.observables):
            found.append(places.read(f"observables[{k}]", value, observable_from))
        names = [measure.name for measure in found]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise ValueError(f"{self.source}: two observables would have the columns {name}; rename one")
        return tuple(found)

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """Every run, in order."""
        seeds = self.grid.get("seed")
        axes = {name: values for name, values in self.grid.items() if name != "seed"}
        repeats = len(seeds) if seeds is not None else self.repeats
        count = repeats * max(len(self.cases), 1) * math.prod(map(len, axes.values()))
        if count > MOST_RUNS:
            raise ValueError(f"{self.source}: {count} runs are more than {MOST_RUNS}; thin out the grid")
        out: list[Run] = []
        keys: dict[str, str] = {}
        for parameters, values in self._points(axes):
            content = {**values, "surface": _by_content(values["surface"])}
            words = _words({name: content[name] for name in ("surface", "cell", "foam")})
            for repeat in range(repeats):
                if seeds is None:
                    seed = _spawned(self.seed, (repeat,) if self.same_seeds else (repeat, *words))
                else:
                    seed = seeds[repeat]
                full = {**values, "seed": seed}
                key = _digest([content, seed, [repr(m) + m.mark for m in self.measures]])[:24]
                shown = ", ".join(f"{name} = {value}" for name, value in parameters.items())
                if key in keys:
                    raise ValueError(f"{self.source}: two runs are the same: {shown} and {keys[key]}")
                keys[key] = shown
                out.append(Run(len(out), repeat, seed, MappingProxyType(parameters), full, key))
        return tuple(out)

    @cached_property
    def fixed(self) -> dict[str, Any]:
        """What must not change while runs are added: all but grid, cases and repeats."""
        return {
            "seed": self.seed,
            "same_seeds": self.same_seeds,
            "observables": [_jsonable(value) for value in self.observables],
            **{name: _jsonable(getattr(self, name)) for name in SHARED},
        }

    def as_mapping(self) -> dict[str, Any]:
        """The study as nested plain values, shaped like its TOML file."""
        return {
            **self.fixed,
            "repeats": self.repeats,
            "states": self.states,
            "grid": _jsonable(self.grid),
            "cases": [_jsonable(case) for case in self.cases],
        }

    def _points(self, axes: Mapping[str, tuple[Any, ...]]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
        """What varies, and all options, at each point of the grid."""
        base = {name: dict(getattr(self, name)) for name in SHARED}
        varied = list(dict.fromkeys([*(name for case in self.cases for name in case), *axes]))
        varied = [name for name in varied if name != "name"]
        first = ["surface.kind", "foam.n_bubbles", "cell.gap"]
        cells: dict[str, Any] = {}
        profiles = {dict(m.options).get("coordinate") for m in self.measures}
        for k, case in enumerate(self.cases or ({},)):
            for chosen in itertools.product(*axes.values()):
                own = {**case, **dict(zip(axes, chosen, strict=True))}
                own.pop("name", None)
                origins = dict.fromkeys(case, f"{self.source}, case {k}")
                origins |= dict.fromkeys(axes, f"{self.source}, grid")
                tables = _merged(base, own)
                options = self._options(tables, origins, cells)
                if "tube_angle" in profiles and options.surface.kind != "torus":
                    raise ValueError(
                        f"{self.source}: coordinate tube_angle needs a torus, got a {options.surface.kind}"
                    )
                values = options.as_mapping()
                parameters: dict[str, Any] = {}
                if self.cases:
                    parameters["case"] = case.get("name", str(k))
                for name in dict.fromkeys([*first, *varied]):
                    section, _, leaf = name.partition(".")
                    value = tables[section].get(leaf, values[section].get(leaf))
                    parameters[name] = _shown(value)
                yield parameters, {name: values[name] for name in SHARED}

    def _options(
        self, tables: dict[str, dict[str, Any]], origins: Mapping[str, str], cells: dict[str, Any]
    ) -> Options:
        places = Places(self.source, origins)
        tables = {**tables, "surface": _plain_sizes(tables["surface"], places)}
        if tables["relax"].get("solver", "auto") == "auto":
            tables["relax"] = {**tables["relax"], "solver": "superlu"}
        options = options_from(tables, self.source, origins, build=False)
        values = options.as_mapping()
        place = json.dumps([values["surface"], values["cell"]])
        if place not in cells:
            try:
                cells[place] = plates_of(values)
            except (TypeError, ValueError) as fault:
                raise ValueError(f"{self.source}: {fault}") from None
        return options


def plates_of(values: Table) -> HeleShawCell:
    """The Hele-Shaw cell of a run's options; the last few are kept, meshes with their smooth surfaces."""
    surface = _by_content(values["surface"])
    text = json.dumps({"surface": values["surface"], "cell": values["cell"]}, sort_keys=True)
    return _plates(text, str(surface.get("file")))


@lru_cache(maxsize=4)
def _plates(text: str, _: str) -> HeleShawCell:
    return options_from(json.loads(text), "study").plates


def read_study(path: str | Path, overrides: Iterable[str] = ()) -> Study:
    r"""Read a study from a TOML file, some of its options replaced by ``section.name=value`` texts.

    Parameters
    ----------
    path : str or Path
        Modules named by observables are looked for in its folder too.
    overrides : iterable of str, optional
        Such as ``"repeats=10"`` or ``"foam.n_bubbles=500"``.

    Raises
    ------
    ValueError
        Not TOML, or anything that `Study` refuses.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "study.toml"
    ...     _ = file.write_text('seed = 1\nrepeats = 5\nobservables = ["mu2"]\n[foam]\nn_bubbles = 100')
    ...     read_study(file, ["repeats=10"]).repeats
    10
    """
    values, origins = read_values(path, overrides)
    places = Places(str(path), origins)
    for name, content in values.items():
        places.require_known(name, list(NAMES), table=isinstance(content, Mapping), sections=SHARED)
    return Study(**values, source=str(path), folder=str(Path(path).resolve().parent))


def _axes(grid: Any, places: Places) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Axes of the grid by dotted name."""
    if not isinstance(grid, Mapping):
        raise ValueError(f"{places.source}: grid must be a section, [grid], got {grid!r}")
    known = _known_axes(SIZES)
    for name, values in _dotted(grid).items():
        if name == "seed":
            places.require_known(name, [name])
        else:
            places.require_known(name, known, sections=SHARED)
        if not isinstance(values, (list, tuple)) or not values:
            raise ValueError(f"{places.source}: grid.{name} must be a list of values, got {values!r}")
        if name == "seed":
            values = [
                places.read("grid.seed", v, lambda v, n: as_integer(v, n, minimum=0, maximum=2**63 - 1))
                for v in values
            ]
        yield name, tuple(values)


def _case(case: Any, k: int, places: Places) -> dict[str, Any]:
    if not isinstance(case, Mapping) or not case:
        raise ValueError(f"{places.source}: cases[{k}] must be a table of options, got {case!r}")
    out = _dotted(case)
    for name in out:
        places.require_known(name, ["name", *_known_axes(SIZES)], sections=SHARED)
    if not isinstance(out.get("name", ""), str):
        raise ValueError(f"{places.source}: cases[{k}].name must be a text, got {out['name']!r}")
    return out


def _dotted(table: Table) -> dict[str, Any]:
    """Entries by dotted name; sections may be nested or dotted already."""
    out: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, Mapping):
            out |= {f"{name}.{leaf}": item for leaf, item in value.items()}
        else:
            out[name] = value
    return out


def _known_axes(kinds: Iterable[str]) -> list[str]:
    names: dict[str, None] = {}
    for kind in kinds:
        own = [*option_names(kind), *(f"surface.{name}" for name in DERIVED.get(kind, ()))]
        names |= dict.fromkeys(n for n in own if n.partition(".")[0] in SHARED)
    return list(names)


def _merged(base: Mapping[str, Table], own: Table) -> dict[str, dict[str, Any]]:
    """The base with some options replaced; another kind of surface starts with its own sizes."""
    out = {name: dict(table) for name, table in base.items()}
    kind = own.get("surface.kind", out["surface"].get("kind", "torus"))
    if kind != out["surface"].get("kind", "torus"):
        out["surface"] = {}
    for name, value in own.items():
        section, _, leaf = name.partition(".")
        out[section][leaf] = value
    return out


def _plain_sizes(table: Table, places: Places) -> dict[str, Any]:
    """Sizes of a torus or a sphere from aspect ratio and area."""
    out = dict(table)
    kind = out.get("kind", "torus")
    known = DERIVED.get(kind, ()) if isinstance(kind, str) else ()
    given = {
        name: places.read(f"surface.{name}", out.pop(name), lambda v, n: as_number(v, n, positive=True))
        for name in known
        if name in out
    }
    if not given:
        return out
    where = places.of("surface.aspect_ratio" if "aspect_ratio" in given else "surface.area")
    names = ("aspect_ratio", "area", *SIZES[kind])
    also = [name for name in SIZES[kind] if name in out]
    if len(given) + len(also) != len(SIZES[kind]):
        count = {1: "one", 2: "two"}[len(SIZES[kind])]
        found = ", ".join([*given, *also])
        raise ValueError(
            f"{where}: the sizes of a {kind} are any {count} of "
            f"{', '.join(n for n in names if n in known or n in SIZES[kind])}; got {found}"
        )
    sizes = {name: places.read(f"surface.{name}", out[name], _positive) for name in also}
    if kind == "sphere":
        out["radius"] = math.sqrt(given["area"] / (4.0 * math.pi))
        return out
    # area 4π² R r, aspect ratio R / r
    product = given["area"] / (4.0 * math.pi**2) if "area" in given else None
    ratio = given.get("aspect_ratio")
    if product is not None and ratio is not None:
        minor = math.sqrt(product / ratio)
        major = ratio * minor
    elif "minor_radius" in sizes:
        minor = sizes["minor_radius"]
        major = ratio * minor if ratio is not None else float(product or 0.0) / minor
    else:
        major = sizes["major_radius"]
        minor = major / ratio if ratio is not None else float(product or 0.0) / major
    out["major_radius"], out["minor_radius"] = major, minor
    return out


def _positive(value: Any, name: str) -> float:
    return as_number(value, name, positive=True)


def _by_content(surface: Table) -> dict[str, Any]:
    """A surface with its file, if it has one, named by what it holds."""
    if "file" not in surface:
        return dict(surface)
    stat = os.stat(surface["file"])
    return {**surface, "file": _file_digest(surface["file"], stat.st_mtime_ns, stat.st_size)}


@lru_cache(maxsize=16)
def _file_digest(path: str, *_: int) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _words(content: Any) -> tuple[int, ...]:
    """Four numbers of 32 bits that stand for the content."""
    return tuple(int(word) for word in np.frombuffer(bytes.fromhex(_digest(content))[:16], dtype="<u4"))


def _spawned(root: int, spawn_key: tuple[int, ...]) -> int:
    """A seed below 2⁶³ from the child of ``SeedSequence(root)`` with this key."""
    return int(np.random.SeedSequence(root, spawn_key=spawn_key).generate_state(1, np.uint64)[0] >> 1)


def _digest(content: Any) -> str:
    text = json.dumps(content, sort_keys=True, allow_nan=False, default=_jsonable)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_jsonable(item) for item in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return value


def _shown(value: Any) -> Any:
    """A parameter as one value of the table."""
    return json.dumps(_jsonable(value)) if isinstance(value, (list, tuple, np.ndarray, Mapping)) else value
