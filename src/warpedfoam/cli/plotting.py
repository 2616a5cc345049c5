"""``warpedfoam plot``: pictures of a saved foam."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from warpedfoam.arrays import as_choice
from warpedfoam.cli.converting import read_foam
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import writable_path
from warpedfoam.plot.style import FORMATS

#: Pictures, and the options that each takes besides those that all take.
KINDS: Mapping[str, tuple[str, ...]] = {
    "foam": ("color_by", "view"),
    "map": ("color_by", "projection", "outline", "vertices"),
    "defects": ("view",),
    "order": ("view",),
    "histogram": ("of",),
    "sides": (),
}


def plot_file(
    file: str, *, frame: int, kind: str, out: str | None, dpi: int, options: Mapping[str, Any]
) -> dict[str, Any]:
    """Draw the foam in ``file`` into a PNG, SVG or PDF, and return the facts.

    Parameters
    ----------
    file : str
        A foam that can be read.
    frame : int
        Of a trajectory.
    kind : str
        One of `KINDS`.
    out : str or None
        The picture; beside ``file``, as PNG, if None.
    dpi : int
    options : mapping
        ``color_by``, ``view``, ``projection``, ``outline``, ``vertices``, ``of``, ``width``, ``title``; those
        not given are None or False.

    Raises
    ------
    ValueError, OSError
        If the file is no foam, an option does not go with the picture, or the picture cannot be written.
    """
    as_choice(kind, "--kind", tuple(KINDS))
    given = {name: value for name, value in options.items() if value is not None and value is not False}
    for name in given:
        if name not in (*KINDS[kind], "width", "title"):
            takers = " or ".join(k for k, names in KINDS.items() if name in names)
            raise ValueError(f"--{name.replace('_', '-')} is for --kind {takers}, not for {kind}")
    if kind == "sides" and "title" in given:
        raise ValueError("--title is not for --kind sides: its panels have titles of their own")
    source = Path(file)
    target = writable_path(
        source.with_name(f"{source.stem}_{kind}.png") if out is None else Path(out), suffixes=FORMATS
    )
    read = read_foam(file, frame)
    if "view" in given:
        given["view"] = _angles(given["view"])
    figure = _drawn(read.foam, kind, given)
    from warpedfoam.plot import save_figure

    save_figure(target, figure, dpi=dpi)
    wide, high = (25.4 * float(inches) for inches in figure.get_size_inches())
    return {
        "file": file,
        "kind": kind,
        "picture": str(target),
        "width_mm": wide,
        "height_mm": high,
        "bytes": target.stat().st_size,
    }


def _drawn(foam: Foam, kind: str, given: dict[str, Any]) -> Any:
    from warpedfoam import plot
    from warpedfoam.analysis import foam_statistics

    if kind == "map":
        named = {"defects" if name == "outline" else name: value for name, value in given.items()}
        return plot.plot_map(foam, named.pop("projection", None), **named)
    if kind == "histogram":
        return plot.plot_histogram(foam, given.pop("of", "area"), **given)
    if kind == "sides":
        return plot.plot_sides(foam_statistics(foam), **given)
    if kind == "defects":
        return plot.plot_defects(foam, **given)
    return plot.plot_order(foam, **given) if kind == "order" else plot.plot_foam(foam, **given)


def _angles(text: str) -> tuple[float, float]:
    try:
        elevation, azimuth = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"--view must be two angles in degrees such as 25,-60, got {text!r}") from None
    return elevation, azimuth
