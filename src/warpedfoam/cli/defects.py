"""``warpedfoam defects``: the defects of a saved foam, as a summary, tables and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpedfoam.analysis import DefectReport, bond_order, defects, foam_statistics
from warpedfoam.cli.converting import read_foam
from warpedfoam.cli.folders import output_folder
from warpedfoam.foam import Foam
from warpedfoam.io import write_columns_csv, write_record
from warpedfoam.io.atomic import writable_path

if TYPE_CHECKING:
    from rich.console import Group

TABLES = ("disclinations", "clusters", "dislocations")
PICTURE, RECORD = "defects.png", "defects.json"


def inspect_file(
    file: str, *, frame: int, out: str | None, tiny: float, picture: bool
) -> tuple[DefectReport, dict[str, Any]]:
    """Find the defects of the foam in ``file``, write tables, picture and record, and return the facts.

    Without a picture, one of an earlier run is removed.

    Parameters
    ----------
    file : str
        A foam that can be read.
    frame : int
        Of a trajectory.
    out : str, optional
        Folder for the results; that of ``file`` by default.
    tiny : float
        As for `warpedfoam.defects`.
    picture : bool
        Write the picture too.

    Raises
    ------
    ValueError, OSError
        If the file is no foam, a number is out of range, or the folder cannot be written.
    """
    foam = read_foam(file, frame).foam
    found = defects(foam, tiny=tiny)
    folder = Path(file).parent if out is None else output_folder(out)
    names = [f"{table}.csv" for table in TABLES] + ([PICTURE] if picture else [])
    paths = {name: writable_path(folder / name) for name in names}
    record = writable_path(folder / RECORD)
    # the record is written last, so that a folder that has one holds the outputs of one run
    record.unlink(missing_ok=True)
    for table in TABLES:
        write_columns_csv(paths[f"{table}.csv"], found.columns(table))
    if picture:
        from warpedfoam.plot import plot_defects, save_figure

        save_figure(paths[PICTURE], plot_defects(foam, found))
    else:
        (folder / PICTURE).unlink(missing_ok=True)
    facts = {
        "file": file,
        **_facts(foam, found),
        "outputs": [str(folder / name) for name in (*names, RECORD)],
    }
    write_record(record, facts)
    return found, facts


def _facts(foam: Foam, found: DefectReport) -> dict[str, Any]:
    statistics = foam_statistics(foam)
    scars = found.clusters.kind == "scar"
    return {
        "surface": type(foam.cell.surface).__name__,
        "euler_characteristic": foam.network.euler_characteristic,
        **found.summary,
        "mu2": statistics.mu2,
        "aboav": statistics.aboav,
        "mean_order": bond_order(foam).mean_magnitude,
        "pairs_per_scar": float(found.clusters.pairs[scars].mean()) if scars.any() else None,
    }


def summary_tables(found: DefectReport, facts: dict[str, Any]) -> Group:
    """Tables for a reader: charges, and clusters by kind."""
    from rich.console import Group
    from rich.table import Table

    charges = Table(title="charges")
    charges.add_column("charge", justify="right")
    charges.add_column("sides", justify="right")
    charges.add_column("bubbles", justify="right")
    rows = found.disclinations
    for charge in sorted(set(rows.charge.tolist()), reverse=True):
        sides = np.unique(rows.sides[rows.charge == charge]).tolist()
        charges.add_row(f"{charge:+d}", ", ".join(map(str, sides)), str(int((rows.charge == charge).sum())))
    charges.add_row("0", "", str(facts["bubbles"] - len(rows.charge)))
    charges.add_section()
    charges.add_row(f"{found.total_charge:+d}" if found.total_charge else "0", "all", str(facts["bubbles"]))

    kinds = Table(title="clusters of charged bubbles")
    for name in ("kind", "clusters", "bubbles", "net charge", "5-7 pairs", "ambiguous"):
        kinds.add_column(name, justify="left" if name == "kind" else "right")
    clusters = found.clusters
    for kind, count in found.kinds.items():
        if count:
            here = clusters.kind == kind
            totals = (
                clusters.size[here],
                clusters.charge[here],
                clusters.pairs[here],
                clusters.ambiguous[here],
            )
            kinds.add_row(kind, str(count), *(str(int(values.sum())) for values in totals))
    return Group(charges, kinds)


def summary_text(facts: dict[str, Any]) -> str:
    """The lines below the tables."""
    scar = facts["pairs_per_scar"]
    aboav = "none" if facts["aboav"] is None else f"{facts['aboav']:.3f}"
    lines = [
        f"foam      {facts['bubbles']} bubbles, Euler characteristic {facts['euler_characteristic']}",
        f"excess    {facts['excess_pairs']} pairs beyond the total charge, {facts['paired']} of neighbours"
        + ("" if scar is None else f"; {scar:.2f} pairs per scar"),
        f"order     mean |psi6| {facts['mean_order']:.3f}, mu2 {facts['mu2']:.3f}, Aboav-Weaire a {aboav}",
    ]
    if facts["tiny_films"]:
        lines.append(
            f"unsure    {facts['ambiguous_charges']} charges, next to films below {facts['tiny']:g} bubble "
            f"sizes (of which there are {facts['tiny_films']})"
        )
    if facts["rim_charges"]:
        lines.append(f"rims      {facts['rim_charges']} charged bubbles lie at a rim")
    lines.append(f"written   {', '.join(facts['outputs'])}")
    return "\n".join(lines)
