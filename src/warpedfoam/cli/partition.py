"""``warpedfoam partition``: search for the shortest films that divide a surface into equal areas."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import numpy as np

from warpedfoam.analysis import point_group
from warpedfoam.cli.folders import output_folder
from warpedfoam.cli.progress import Progress
from warpedfoam.io import save, versions, write_columns_csv, write_record
from warpedfoam.sizes import SIZES
from warpedfoam.studies import MinimalPartition, minimal_partition
from warpedfoam.studies.options import SurfaceOptions, options_from

FOAM, TRIES, PICTURE, RECORD, STATE = "partition.npz", "tries.csv", "partition.png", "partition.json", "state"


def search(
    surface: str,
    sizes: Sequence[str],
    n: int,
    *,
    seed: int,
    starts: int,
    hops: int,
    out: str,
    picture: bool,
    progress: Progress,
) -> dict[str, Any]:
    """Search, write the foam, the tries, a picture and the record to ``out``, and return the facts.

    A run that was stopped goes on from ``out/state``; so does one with more starts.

    Parameters
    ----------
    surface : str
        A kind of surface, or the name of a mesh file.
    sizes : sequence of str
        ``name=value`` each.
    """
    chosen = surface_options(surface, sizes)
    folder = output_folder(out)
    built = chosen.build()
    found = minimal_partition(
        built, n, seed=seed, starts=starts, hops=hops, folder=folder / STATE, progress=progress
    )
    # the record is written last: a folder that has one holds the outputs of one search
    (folder / RECORD).unlink(missing_ok=True)
    save(folder / FOAM, found.foam)
    tries = found.tries
    write_columns_csv(
        folder / TRIES,
        {
            "start": np.array([t.start for t in tries]),
            "kind": np.array([t.kind for t in tries]),
            "first_length": _numbers([t.first_length for t in tries]),
            "length": _numbers([t.length for t in tries]),
            "hops": np.array([t.n_hops for t in tries]),
            "message": np.array([t.message for t in tries]),
        },
    )
    names = [FOAM, TRIES]
    if picture:
        from warpedfoam.plot import save_picture

        title = f"{n} equal areas, length {found.length:.8g}"
        save_picture(folder / PICTURE, found.foam, color_by="charge", title=title)
        names.append(PICTURE)
    else:
        (folder / PICTURE).unlink(missing_ok=True)
    facts = {
        "surface": {"kind": chosen.kind, **chosen.sizes},
        "n_bubbles": n,
        "seed": seed,
        "starts": starts,
        "hops": hops,
        **_facts(found),
        "versions": versions(),
        "outputs": [str(folder / name) for name in (*names, RECORD)],
    }
    write_record(folder / RECORD, facts)
    return facts


def _numbers(values: list[float | None]) -> np.ndarray:
    return np.array([np.nan if v is None else v for v in values])


def surface_options(name: str, sizes: Sequence[str]) -> SurfaceOptions:
    """A surface from its kind or the name of a mesh file, and ``name=value`` sizes."""
    table: dict[str, Any] = {"kind": name}
    if PurePath(name).suffix:
        table = {"kind": "mesh", "file": name}
    for text in sizes:
        key, sign, value = (part.strip() for part in text.partition("="))
        if not sign or not key:
            raise ValueError(f"--size {text}: write it as name=value, such as --size radius=1")
        if isinstance(SIZES.get(table["kind"], {}).get(key), str):
            table[key] = value
            continue
        try:
            table[key] = float(value)
        except ValueError:
            raise ValueError(f"--size {text}: {value!r} is not a number") from None
    options: SurfaceOptions = options_from({"surface": table}, "command line").surface
    return options


def _facts(found: MinimalPartition) -> dict[str, Any]:
    foam = found.foam
    sides, counts = np.unique(foam.network.sides, return_counts=True)
    surface = foam.cell.surface
    closed = surface.period is None and surface.rim is None
    group = point_group(foam) if closed and (foam.network.vertex_degrees == 3).all() else None
    return {
        "length": found.length,
        "length_correction": found.length_correction,
        "residual": found.residual,
        "reached": found.n_reached,
        "failed": sum(t.length is None for t in found.tries),
        "sides": {str(int(s)): int(c) for s, c in zip(sides, counts, strict=True)},
        "point_group": None if group is None else group.name,
        "point_group_order": None if group is None else group.order,
    }


def summary_text(facts: dict[str, Any]) -> str:
    """A few lines for a reader."""
    sides = "   ".join(f"{n}: {count}" for n, count in facts["sides"].items())
    group = (
        ""
        if facts["point_group"] is None
        else (f"   symmetry {facts['point_group']}, of order {facts['point_group_order']}")
    )
    return "\n".join(
        [
            f"length    {facts['length']:.10g} for {facts['n_bubbles']} equal areas, residual "
            f"{facts['residual']:.1g}",
            f"search    reached by {facts['reached']} of {facts['starts']} starts, {facts['failed']} failed, "
            f"seed {facts['seed']}",
            f"sides     {sides}{group}",
            f"written   {', '.join(facts['outputs'])}",
        ]
    )
