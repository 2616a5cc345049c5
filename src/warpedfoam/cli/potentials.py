"""``warpedfoam potential``: the energy of one bubble over its place, as a table, a picture and a record."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np

from warpedfoam.arrays import Floats, as_choice, as_integer, as_number
from warpedfoam.cell import HeleShawCell
from warpedfoam.cli.folders import output_folder
from warpedfoam.io import versions, write_record
from warpedfoam.io.atomic import writable_path
from warpedfoam.sizes import SIZES
from warpedfoam.studies import GeometricPotential, geometric_potential, write_potential_csv
from warpedfoam.studies.options import MAKERS
from warpedfoam.studies.rims import disks_over_rim
from warpedfoam.surfaces import Surface, Torus

METHODS = ("theory", "ruled", "free")
TABLE, PICTURE, CURVES, RECORD = "potential.csv", "potential.png", "potential_path.png", "potential.json"


def map_potential(surface: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Evaluate the potential, write table, picture and record, and return the facts.

    Parameters
    ----------
    surface : mapping
        ``kind`` and sizes.
    given : mapping
        ``gap``, ``volume``, ``points``, ``along`` (of tori only: places along φ instead), ``method``,
        ``layers``, ``out``, ``picture``.

    Raises
    ------
    ValueError, OSError
        Options that make no potential; a folder that cannot be written.
    """
    kind = surface["kind"]
    sizes = {name: value for name, value in surface.items() if name != "kind"}
    for name, value in sizes.items():
        if not isinstance(value, str):
            as_number(value, name, positive=True)
    methods = [as_choice(part.strip(), "--method", METHODS) for part in given["method"].split(",")]
    if len(set(methods)) < len(methods):
        raise ValueError(f"--method must name each method once, got {given['method']}")
    volume = as_number(given["volume"], "--volume", positive=True)
    along = given.get("along")
    if along is None:
        count = as_integer(given["points"], "--points", minimum=50, maximum=100_000)
    else:
        count = as_integer(along, "--along", minimum=2, maximum=100_000)
    made = MAKERS[kind](**{**SIZES[kind], **sizes})
    cell = HeleShawCell(made, as_number(given["gap"], "--gap", positive=True))
    folder = output_folder(given["out"])
    record = writable_path(folder / RECORD)
    record.unlink(missing_ok=True)
    started, clock = datetime.now(UTC), time.perf_counter()
    where: dict[str, Any] = {"nodes": count} if along is None else {"path": _along(made, count)}
    found = [
        geometric_potential(cell, volume, method=method, layers=given["layers"], **where)
        for method in methods
    ]
    seconds = time.perf_counter() - clock
    outputs = [write_potential_csv(folder / TABLE, *found)]
    if given["picture"] and np.isfinite(found[-1].energies).any():
        from warpedfoam.plot import plot_potential, save_figure

        outputs.append(save_figure(folder / PICTURE, plot_potential(found[-1])))
    else:
        (folder / PICTURE).unlink(missing_ok=True)
    if given["picture"] and along is not None:
        from warpedfoam.plot import plot_potential_path, save_figure

        outputs.append(save_figure(folder / CURVES, plot_potential_path(found)))
    else:
        (folder / CURVES).unlink(missing_ok=True)
    facts = {
        "surface": {"kind": kind, **sizes},
        "gap": cell.mean_gap,
        "volume": volume,
        "flat_energy": found[0].flat_energy,
        "methods": {one.method: _told(one) for one in found},
        "places": len(found[0].points),
        "along_phi": along is not None,
        "layers": given["layers"],
        "seconds": seconds,
        "started": started.isoformat(timespec="seconds"),
        "versions": dict(versions()),
        "command": sys.argv,
        "outputs": [*map(str, outputs), str(record)],
    }
    write_record(record, facts)
    return facts


def _along(surface: Surface, count: int) -> Floats:
    """Places on the torus from the outer equator over the top to the inner one."""
    if not isinstance(surface, Torus):
        raise ValueError("--along is for tori: places along the angle phi round the tube")
    return surface.points(np.linspace(0.0, np.pi, count), np.zeros(count))


def _told(one: GeometricPotential) -> dict[str, Any]:
    known = np.isfinite(one.energies)
    # the film's own radii differ a little from the flat one
    radius = 1.1 * float(np.sqrt(one.volume / (np.pi * one.cell.mean_gap)))
    over = disks_over_rim(one.cell.surface, one.points, radius)
    size = np.linalg.norm(one.forces[known], axis=1)
    least, most = None, None
    if known.any():
        least, most = int(np.nanargmin(one.energies)), int(np.nanargmax(one.energies))
    return {
        "at_rest": int(one.converged.sum()),
        "over_rim": int((~one.converged & over).sum()),
        "least_ratio": None if least is None else float(one.ratios[least]),
        "least_at": None if least is None else one.points[least].tolist(),
        "greatest_ratio": None if most is None else float(one.ratios[most]),
        "greatest_at": None if most is None else one.points[most].tolist(),
        "greatest_force": float(size.max()) if known.any() else None,
    }


def summary_text(facts: dict[str, Any]) -> str:
    """A few lines for a reader."""
    sizes = {name: value for name, value in facts["surface"].items() if name != "kind"}
    told = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in sizes.items())
    lines = [
        f"bubble    volume {facts['volume']:g} in a gap {facts['gap']:g} on a {facts['surface']['kind']} "
        f"({told}), E0 = {facts['flat_energy']:.8g}"
    ]
    for name, one in facts["methods"].items():
        if one["least_ratio"] is None:
            lines.append(f"{name:9s} no bubble came to rest")
            continue
        low, high = ([round(float(x), 3) for x in one[key]] for key in ("least_at", "greatest_at"))
        lines.append(
            f"{name:9s} E/E0 from {one['least_ratio']:.9f} at {low} to {one['greatest_ratio']:.9f} "
            f"at {high}, force up to {one['greatest_force']:.2e}, {one['at_rest']} of {facts['places']} "
            "at rest" + (f", {one['over_rim']} too close to the rim" if one["over_rim"] else "")
        )
    lines += [f"time      {facts['seconds']:.1f} s", f"written   {', '.join(facts['outputs'])}"]
    return "\n".join(lines)


def all_at_rest(facts: dict[str, Any]) -> bool:
    """Whether every bubble of every method has an energy, but for those too close to a rim."""
    return all(one["at_rest"] + one["over_rim"] == facts["places"] for one in facts["methods"].values())
