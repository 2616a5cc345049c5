"""``warpedfoam figures paper``: every figure of the paper and two new ones, each with its table."""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from warpedfoam.cli.folders import output_folder
from warpedfoam.cli.progress import Progress, silent
from warpedfoam.io import versions, write_record
from warpedfoam.io.atomic import writable_path
from warpedfoam.io.tables import write_columns_csv
from warpedfoam.plot.style import Style

if TYPE_CHECKING:
    from warpedfoam.plot import Charted

#: The paper's cells, and where films are computed.
GAP, VOLUMES = 0.5, (0.3, 0.4, 0.5, 0.6, 0.7)
RADII = (10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0, 26.0)
DEGREES = tuple(float(phi) for phi in range(0, 181, 15))
RECORD = "figures.json"
NAMES = ("curvature", "spheres", "torus", "surface", "circles", "gap", "second_order", "cylinder")
Columns = dict[str, Any]


def draw_paper(
    out: str,
    *,
    only: list[str] | None = None,
    torus_table: str | None = None,
    layers: int = 4,
    width: float | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Draw the figures into the folder ``out``: NAME.png, NAME.csv, tables of the films, a record.

    Parameters
    ----------
    out : str
    only : list of str, optional
        Some of `NAMES`; all by default.
    torus_table : str, optional
        Take the films on the torus from this table (``data/torus_potential.csv``) instead of computing them.
    layers : int, optional
        Layers of the films on spheres, tori and cylinders; the errors of theory are found with six.

    width : float, optional
        Millimetres at which the figures are to be printed: 86 for one column.

    Returns
    -------
    dict
        What the record holds.

    Raises
    ------
    ValueError, OSError
        If a name is not known, the table is none, or the folder cannot be written.
    ConvergenceError
        If a film does not come to rest.
    """
    chosen = list(dict.fromkeys(only or NAMES))
    for name in chosen:
        if name not in NAMES:
            raise ValueError(f"there is no figure {name!r}; figures are {', '.join(NAMES)}")
    if not 2 <= layers <= 12:
        raise ValueError(f"--layers must be from 2 to 12, got {layers}")
    Style.of(width)  # refuse before films are computed
    given = None if torus_table is None else _read_torus(torus_table)
    folder = output_folder(out)
    record = writable_path(folder / RECORD)
    record.unlink(missing_ok=True)
    started, outputs, seconds = datetime.now(UTC), [], {}
    for name in chosen:
        clock = time.perf_counter()
        progress(name, 0.0)
        chart, films = _chart(name, layers, given, width, partial(progress, name))
        outputs.append(str(chart.save(folder / f"{name}.png")))
        outputs.append(str(chart.write_csv(folder / f"{name}.csv")))
        if films is not None:
            outputs.append(str(write_columns_csv(folder / f"{name}_films.csv", films)))
        progress(name, 1.0)
        seconds[name] = time.perf_counter() - clock
    facts = {
        "figures": chosen,
        "gap": GAP,
        "volumes": list(VOLUMES),
        "layers": layers,
        "width_mm": width,
        "torus_films": f"computed, {layers} layers" if torus_table is None else f"taken from {torus_table}",
        "seconds": seconds,
        "started": started.isoformat(timespec="seconds"),
        "versions": dict(versions()),
        "command": sys.argv,
        "outputs": [*outputs, str(record)],
    }
    write_record(record, facts)
    return facts


def summary_text(facts: dict[str, Any]) -> str:
    """A few lines for a reader."""
    lines = [f"{name:13s} {facts['seconds'][name]:6.1f} s" for name in facts["figures"]]
    if "torus" in facts["figures"]:
        lines.append(f"torus films   {facts['torus_films']}")
    return "\n".join([*lines, f"written       {', '.join(facts['outputs'])}"])


def _chart(
    name: str, layers: int, given: Columns | None, width: float | None, report: Callable[[float], None]
) -> tuple[Charted, Columns | None]:
    """The figure, and the films in it that its table does not hold."""
    from warpedfoam import plot
    from warpedfoam.studies import paper_films

    if name == "spheres":
        films = paper_films.sphere_films(GAP, VOLUMES, RADII, layers=layers, report=report)
        points = (films["sphere_radius"], films["volume"], films["ratio"])
        return plot.figure_spheres(GAP, VOLUMES, points=points, width=width), films
    if name == "torus":
        films = given or paper_films.torus_films(GAP, VOLUMES, DEGREES, layers=layers, report=report)
        points = (films["phi_degrees"], films["volume"], films["ratio"])
        return plot.figure_torus_energy(GAP, VOLUMES, points=points, width=width), films
    if name == "second_order":
        scaled = paper_films.scaled_films(GAP, 0.5, report=report)
        along = {
            "free": paper_films.torus_films(GAP, [0.5], DEGREES, layers=6),
            "ruled": paper_films.torus_films(GAP, [0.5], DEGREES, layers=1),
        }
        chart = plot.figure_second_order(GAP, 0.5, films=scaled, along=along, width=width)
        both = {
            "phi_degrees": along["free"]["phi_degrees"],
            "free_ratio": along["free"]["ratio"],
            "ruled_ratio": along["ruled"]["ratio"],
        }
        return chart, both
    if name == "cylinder":
        return plot.figure_cylinder(GAP, width=width), None
    plain: dict[str, Callable[..., Charted]] = {
        "curvature": plot.figure_curvature,
        "surface": plot.figure_surface,
        "circles": plot.figure_circles,
        "gap": plot.figure_gap,
    }
    return plain[name](width=width), None


def _read_torus(file: str) -> Columns:
    """Films of a table with columns V, phi_degrees, free_energy, free_ratio and free_pressure."""
    wanted = {
        "phi_degrees": "phi_degrees",
        "volume": "V",
        "energy": "free_energy",
        "ratio": "free_ratio",
        "pressure": "free_pressure",
    }
    with open(file, encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    try:
        columns = {name: np.array([float(row[column]) for row in rows]) for name, column in wanted.items()}
    except (KeyError, TypeError, ValueError) as fault:
        raise ValueError(
            f"{file} is no table of films on the torus: it needs numbers in the columns "
            f"{', '.join(wanted.values())} ({type(fault).__name__}: {fault})"
        ) from None
    if not rows or not all(np.isfinite(column).all() for column in columns.values()):
        raise ValueError(f"{file} is no table of films on the torus: it has no rows, or numbers are missing")
    return columns
