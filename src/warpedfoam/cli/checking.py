"""``warpedfoam check``: a mesh file's health, in words."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from warpedfoam.arrays import as_integer
from warpedfoam.errors import MeshError
from warpedfoam.io import write_mesh
from warpedfoam.io.atomic import writable_path
from warpedfoam.surfaces import MeshReport, mesh_report, read_mesh, repaired
from warpedfoam.surfaces.health import SAFE_EDGES
from warpedfoam.surfaces.holes import MOST_EDGES


def check_file(
    file: str, *, gap: float | None, n_bubbles: int | None, repair: str | None, close_holes: int | None = None
) -> tuple[bool, str, dict[str, Any]]:
    """Whether the mesh (as repaired, if asked for) is sound, a text for a reader, and the facts.

    Parameters
    ----------
    file : str
    gap, n_bubbles : optional
        See `warpedfoam.surfaces.mesh_report`.
    repair : str, optional
        Where to write the repaired mesh, a new file; it is written only if it is sound.
    close_holes : int, optional
        Holes of up to so many edges are closed too.

    Raises
    ------
    ValueError, OSError
        If the mesh cannot be read, or ``repair`` is no name for a new file.
    """
    if close_holes is not None and repair is None:
        raise ValueError("--close-holes says what --repair closes; add --repair FILE.ply")
    edges = SAFE_EDGES
    if close_holes is not None:
        edges = as_integer(close_holes, "--close-holes", minimum=SAFE_EDGES, maximum=MOST_EDGES)
    target = None if repair is None else _new_file(repair)
    mesh = read_mesh(file)
    report = mesh_report(mesh, gap=gap, n_bubbles=n_bubbles)
    lines = [_described(file, report)]
    facts: dict[str, Any] = {"file": file, "sound": report.sound, **_plain(report)}
    if target is None and report.sound:
        return True, "\n".join(lines), facts
    try:
        mended, done = repaired(mesh, hole_edges=edges)
    except MeshError as fault:
        lines.append(f"repair    not possible: {fault}")
        facts["repair"] = {"done": [], "sound": False, "file": None, "message": str(fault)}
        return False, "\n".join(lines), facts
    after = mesh_report(mended, gap=gap, n_bubbles=n_bubbles)
    facts["repair"] = {"done": list(done), "sound": after.sound, "file": None, **_plain(after)}
    what = ", ".join(done) or "nothing to do that is safe"
    if target is None:
        # only an offer: nothing is mended unasked
        if after.sound:
            lines.append(f"repair    would make it sound ({what}): add --repair FILE.ply")
        else:
            lines.append("repair    no safe one makes it sound; mend it in a mesh editor")
        return False, "\n".join(lines), facts
    lines.append(f"repair    {what}")
    lines.append(_described(str(target) if after.sound else "after repair", after))
    if after.sound:
        write_mesh(target, mended)
        facts["repair"]["file"] = repair
        lines.append(f"written   {repair}")
    else:
        lines.append("not written: it would still carry no foam; mend it in a mesh editor")
    return after.sound, "\n".join(lines), facts


def _new_file(name: str) -> Path:
    """Where a repaired mesh may go: no file is there yet, the mesh itself least of all."""
    target = writable_path(name, suffixes=(".ply",))
    if target.exists() or target.is_symlink():
        raise ValueError(f"--repair {name}: there is such a file already; choose another name or remove it")
    return target


def _described(name: str, report: MeshReport) -> str:
    handles = (2 - report.euler_characteristic - report.rims) // 2
    lines = [
        f"mesh      {name}: {report.n_nodes} nodes, {report.n_triangles} triangles, area {report.area:.6g}, "
        f"mean edge {report.mean_edge:.3g}, least angle {report.least_angle:.1f} degrees",
        f"topology  Euler characteristic {report.euler_characteristic}"
        + (f" (genus {handles})" if report.sound else "")
        + f", {_counted(report.components, 'component')}, {_counted(report.rims, 'rim')}",
    ]
    if report.curvature_range is not None:
        low, high = report.curvature_range
        room = f"gaps up to {-1.0 / low:.3g} do not fold" if low < 0.0 else "no gap folds"
        lines.append(f"curvature {low:.4g} to {high:.4g} on the smooth surface; {room}")
    for finding in report.findings:
        kind = "FAULT" if finding.fatal else "note"
        place = f"{finding.count}; first: {finding.where}" if finding.count > 1 else finding.where
        lines.append(f"{kind:<9} {finding.fault} ({place}): {finding.advice}")
    lines.append(f"verdict   {'can carry a foam' if report.sound else 'cannot carry a foam'}")
    return "\n".join(lines)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _plain(report: MeshReport) -> dict[str, Any]:
    """The report as JSON may hold it: no NaN."""
    facts = asdict(report)
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in facts.items()}
