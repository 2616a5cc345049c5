"""Options of the main job and of studies: read from TOML and from ``--set``, each checked by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from warpedfoam.arrays import as_choice, as_flag, as_floats, as_integer, as_number, as_points
from warpedfoam.cell import HeleShawCell
from warpedfoam.foam import MAX_ORDER
from warpedfoam.io.colours import COLOR_CHOICES
from warpedfoam.relax.linear import SOLVERS
from warpedfoam.sizes import SIGNED, SIZES
from warpedfoam.surfaces import (
    Catenoid,
    Cylinder,
    Ellipsoid,
    FlatTorus,
    Graph,
    Implicit,
    MeshSurface,
    Revolution,
    SchwarzP,
    Sphere,
    Surface,
    Torus,
)
from warpedfoam.tessellate.build import CELL_KINDS, MOST_BUBBLES, MOST_NODES, SEED_KINDS

Section = TypeVar("Section")
DEFAULT_BUBBLES = 200

#: What the edge of a graph may be.
EDGES = ("rim", "joined", "disk")


def _implicit(formula: str, bounds: str) -> Implicit:
    try:
        corners = [float(number) for number in bounds.replace(",", " ").split()]
    except ValueError:
        corners = []
    if len(corners) != 6:
        raise ValueError(
            f"bounds must be six numbers, two corners of a box such as '-2, -2, -2, 2, 2, 2', got {bounds!r}"
        )
    return Implicit.from_formula(formula, [corners[:3], corners[3:]])


def _graph(formula: str, width: float, height: float, edge: str) -> Graph:
    as_choice(edge, "edge", EDGES)
    return Graph.from_formula(formula, width, height, periodic=edge == "joined", disk=edge == "disk")


#: What makes each kind of surface from its sizes.
MAKERS: Mapping[str, Callable[..., Surface]] = {
    "torus": Torus,
    "sphere": Sphere,
    "ellipsoid": Ellipsoid,
    "cylinder": lambda radius, height: Cylinder(radius, height, periodic=True),
    "open_cylinder": Cylinder,
    "catenoid": Catenoid,
    "flat_torus": FlatTorus,
    "schwarz_p": SchwarzP,
    "implicit": _implicit,
    "graph": _graph,
    "revolution": Revolution.from_formula,
    "mesh": lambda file: MeshSurface.from_file(file),
}


def read_by(reader: Callable[[Any, str], Any]) -> Mapping[str, Any]:
    """Return the metadata of a dataclass field whose values ``reader(value, name)`` checks and converts."""
    return {"read": reader}


def _at_least(minimum: int, most: int | None = None) -> Callable[[Any, str], int]:
    return lambda value, name: as_integer(value, name, minimum=minimum, maximum=most)


def _above_zero(value: Any, name: str) -> float:
    return as_number(value, name, positive=True)


def _order(value: Any, name: str) -> int:
    return as_integer(value, name, minimum=2, maximum=MAX_ORDER)


def _tolerance(value: Any, name: str) -> float:
    return as_number(value, name, minimum=1e-13)


def _one_of(*choices: str) -> Callable[[Any, str], str]:
    return lambda value, name: as_choice(value, name, choices)


def _text(value: Any, name: str) -> str:
    if not isinstance(value, str) or not value:
        raise TypeError(f"{name} must be a text in quotes, got {value!r}")
    return value


def _seeds(value: Any, name: str) -> Any:
    if isinstance(value, list):
        return as_points(value, name).tolist()
    return as_choice(value, name, SEED_KINDS)


def _volumes(value: Any, name: str) -> Any:
    if isinstance(value, list):
        return as_floats(value, name, (None,)).tolist()
    return as_number(value, name, minimum=0.0)


@dataclass(frozen=True)
class SurfaceOptions:
    """Which surface, and its sizes."""

    kind: str = "torus"
    sizes: Mapping[str, float | str] = field(default_factory=dict)

    def build(self) -> Surface:
        """Make the surface; sizes not given are those of `SIZES`."""
        return MAKERS[self.kind](**{**SIZES[self.kind], **self.sizes})


@dataclass(frozen=True)
class CellOptions:
    """The Hele-Shaw cell."""

    gap: float = field(default=0.5, metadata=read_by(_above_zero))


@dataclass(frozen=True)
class FoamOptions:
    """What `warpedfoam.voronoi_foam` is given; None leaves it its own default."""

    n_bubbles: int | None = field(default=None, metadata=read_by(_at_least(1, MOST_BUBBLES)))
    seeds: Any = field(default="random", metadata=read_by(_seeds))
    cells: str = field(default="voronoi", metadata=read_by(_one_of(*CELL_KINDS)))
    lloyd: int = field(default=0, metadata=read_by(_at_least(0)))
    volumes: Any = field(default=None, metadata=read_by(_volumes))
    n_nodes: int | None = field(default=None, metadata=read_by(_at_least(1, MOST_NODES)))


@dataclass(frozen=True)
class RelaxOptions:
    """What `warpedfoam.relax` is given; the defaults are its own."""

    order: int = field(default=4, metadata=read_by(_order))
    t1: bool = field(default=True, metadata=read_by(as_flag))
    max_iterations: int = field(default=1000, metadata=read_by(_at_least(0)))
    tolerance: float = field(default=1e-10, metadata=read_by(_tolerance))
    solver: str = field(default="auto", metadata=read_by(_one_of(*SOLVERS)))


@dataclass(frozen=True)
class OutputOptions:
    """Where the results go, and the picture's colours."""

    folder: str = field(default="out", metadata=read_by(_text))
    color_by: str = field(default="charge", metadata=read_by(_one_of(*COLOR_CHOICES)))
    picture: bool = field(default=True, metadata=read_by(as_flag))


@dataclass(frozen=True)
class Options:
    """Every option of the main job."""

    seed: int = field(default=0, metadata=read_by(_at_least(0)))
    surface: SurfaceOptions = SurfaceOptions()
    cell: CellOptions = CellOptions()
    foam: FoamOptions = FoamOptions()
    relax: RelaxOptions = RelaxOptions()
    output: OutputOptions = OutputOptions()

    @cached_property
    def plates(self) -> HeleShawCell:
        """The Hele-Shaw cell, made once; sizes that contradict each other raise ``ValueError``."""
        return HeleShawCell(self.surface.build(), gap=self.cell.gap)

    @property
    def n_bubbles(self) -> int | None:
        """Number of bubbles asked for; None if the seeds are given one by one."""
        if self.foam.n_bubbles is None and isinstance(self.foam.seeds, str):
            return DEFAULT_BUBBLES
        return self.foam.n_bubbles

    def as_mapping(self) -> dict[str, Any]:
        """The options as nested plain values, shaped like the TOML file, defaults filled in."""
        out = asdict(self)
        out["surface"] = {"kind": self.surface.kind, **SIZES[self.surface.kind], **self.surface.sizes}
        out["foam"]["n_bubbles"] = self.n_bubbles
        return out


SECTIONS: Mapping[str, type[Any]] = {
    "cell": CellOptions,
    "foam": FoamOptions,
    "relax": RelaxOptions,
    "output": OutputOptions,
}


def read_options(path: str | Path, overrides: Iterable[str] = ()) -> Options:
    """Read options from a TOML file, some of them replaced by ``section.name=value`` texts.

    Parameters
    ----------
    path : str or Path
        The TOML file; its folder plays no part.
    overrides : iterable of str, optional
        Such as ``"foam.n_bubbles=500"``; the value as in TOML, quotes may be left out.

    Returns
    -------
    Options

    Raises
    ------
    ValueError
        Not TOML, an unknown option (near matches are named), or a value of the wrong type or range.
    OSError
        If the file cannot be read.
    """
    values, origins = read_values(path, overrides)
    return options_from(values, str(path), origins)


def read_values(path: str | Path, overrides: Iterable[str] = ()) -> tuple[dict[str, Any], dict[str, str]]:
    """Return what a TOML file holds, with ``section.name=value`` texts put in, and where those come from.

    Raises
    ------
    ValueError
        Not TOML, or an override that is none.
    OSError
        If the file cannot be read.
    """
    import tomllib

    data = Path(path).read_bytes()
    try:
        values = tomllib.loads(data.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise ValueError(f"{path} is not a TOML file: {fault}") from None
    origins: dict[str, str] = {}
    for text in overrides:
        _override(values, origins, text)
    return values, origins


def options_from(
    values: Mapping[str, Any],
    source: str,
    origins: Mapping[str, str] | None = None,
    *,
    build: bool = True,
) -> Options:
    """Check nested plain values and return them as `Options`.

    Parameters
    ----------
    values : mapping
        Shaped like the TOML file.
    source : str
        Where they come from, for messages.
    origins : mapping of str to str, optional
        Where single options (``"foam.lloyd"``) come from, if elsewhere.
    build : bool, optional
        Make the plates too, to see whether their sizes agree.

    Raises
    ------
    ValueError
        As in `read_options`.

    Examples
    --------
    >>> options_from({"foam": {"n_bubles": 3}}, "foam.toml")
    Traceback (most recent call last):
    ValueError: foam.toml: unknown option foam.n_bubles; did you mean foam.n_bubbles?
    """
    places = Places(source, origins or {})
    surface = _surface(_table(values, "surface", places), places)
    known = option_names(surface.kind)
    for section, content in values.items():
        if section in SECTIONS:
            for name in _table(values, section, places):
                places.require_known(f"{section}.{name}", known)
        elif section != "surface":
            places.require_known(section, known, table=isinstance(content, Mapping))
    sections = {
        section: _section(kind, section, _table(values, section, places), places)
        for section, kind in SECTIONS.items()
    }
    seed = places.read("seed", values["seed"], _at_least(0)) if "seed" in values else 0
    options = Options(seed=seed, surface=surface, **sections)
    if build:
        try:
            _ = options.plates
        except (TypeError, ValueError) as fault:
            raise ValueError(f"{source}: {fault}") from None
    return options


@dataclass(frozen=True)
class Places:
    """Where options come from, for messages: a source, and other origins of single options."""

    source: str
    origins: Mapping[str, str]

    def of(self, name: str) -> str:
        """Where the option comes from."""
        return self.origins.get(name, self.source)

    def read(self, name: str, value: Any, reader: Callable[[Any, str], Any]) -> Any:
        """Return ``reader(value, name)``; its refusal is a ``ValueError`` that says where."""
        try:
            return reader(value, name)
        except (TypeError, ValueError) as fault:
            raise ValueError(f"{self.of(name)}: {fault}") from None

    def require_known(
        self,
        name: str,
        known: list[str],
        *,
        table: bool = False,
        sections: Sequence[str] = ("surface", *SECTIONS),
    ) -> None:
        """Refuse a name that is not known; near matches are named."""
        if name in known:
            return
        kind = "section" if table else "option"
        hint = _suggestion(name, known, sections if table else None)
        raise ValueError(f"{self.of(name)}: unknown {kind} {name}; {hint}")


def _suggestion(name: str, known: list[str], sections: Sequence[str] | None) -> str:
    if sections is not None:
        near = difflib.get_close_matches(name, sections, n=1)
        return f"did you mean {near[0]}?" if near else f"sections are {', '.join(sections)}"
    near = difflib.get_close_matches(name, known, n=2, cutoff=0.75)
    leaves = {known_name.rpartition(".")[2]: known_name for known_name in known}
    near += [leaves[leaf] for leaf in difflib.get_close_matches(name.rpartition(".")[2], leaves, n=2)]
    near = list(dict.fromkeys(near))[:2]
    if near:
        return f"did you mean {' or '.join(near)}?"
    section = name.rpartition(".")[0] + "."
    return "options are " + ", ".join([k for k in known if k.startswith(section)] or known)


def option_names(kind: str) -> list[str]:
    """Dotted names of all options for a kind of surface."""
    names = ["seed", "surface.kind", *(f"surface.{name}" for name in SIZES[kind])]
    for section, options in SECTIONS.items():
        names += [f"{section}.{f.name}" for f in fields(options)]
    return names


def _table(values: Mapping[str, Any], section: str, places: Places) -> Mapping[str, Any]:
    table = values.get(section, {})
    if not isinstance(table, Mapping):
        raise ValueError(f"{places.of(section)}: {section} must be a section, [{section}], got {table!r}")
    return table


def _surface(table: Mapping[str, Any], places: Places) -> SurfaceOptions:
    kind = places.read("surface.kind", table.get("kind", "torus"), _one_of(*SIZES))
    sizes = {}
    for name, value in table.items():
        if name != "kind":
            places.require_known(f"surface.{name}", option_names(kind))
            reader = (
                _text if isinstance(SIZES[kind][name], str) else as_number if name in SIGNED else _above_zero
            )
            sizes[name] = places.read(f"surface.{name}", value, reader)
    if kind == "mesh" and "file" not in sizes:
        raise ValueError(f"{places.of('surface')}: surface.file is needed: the name of a mesh file")
    return SurfaceOptions(kind, sizes)


def _section(kind: type[Section], section: str, table: Mapping[str, Any], places: Places) -> Section:
    read = {f.name: f.metadata["read"] for f in fields(kind)}  # type: ignore[arg-type]
    return kind(
        **{name: places.read(f"{section}.{name}", value, read[name]) for name, value in table.items()}
    )


def _override(values: dict[str, Any], origins: dict[str, str], text: str) -> None:
    """Put one ``section.name=value`` into the nested values."""
    import tomllib

    name, sign, value = (part.strip() for part in text.partition("="))
    if not sign or not name or not value:
        raise ValueError(f"--set {text}: write it as section.name=value, such as --set foam.n_bubbles=500")
    try:
        parsed: Any = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value
    section, _, leaf = name.rpartition(".")
    if name.startswith("grid.") and isinstance(values.get("grid", {}), dict):
        # the axes of a study are options too; the whole name stands for one in sections
        section, leaf = "grid", name.removeprefix("grid.")
        outer, _, inner_name = leaf.partition(".")
        if isinstance(values.get("grid", {}).get(outer), dict):
            values["grid"][outer].pop(inner_name, None)
    if "." in section:
        raise ValueError(f"--set {text}: there is no option {name}; write it as section.name=value")
    if section and section not in values:
        origins[section] = f"--set {text}"
    inner = values.setdefault(section, {}) if section else values
    if not isinstance(inner, dict):
        raise ValueError(f"--set {text}: {section} is not a section")
    inner[leaf] = parsed
    origins[name] = f"--set {text}"
