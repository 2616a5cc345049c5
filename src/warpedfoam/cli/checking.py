"""``warpedfoam check``: a mesh file's health, in words."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from warpedfoam.surfaces import MeshReport, mesh_report, read_mesh, repaired


def check_file(
    file: str, *, gap: float | None, n_bubbles: int | None, repair: str | None
) -> tuple[bool, str, dict[str, Any]]:
    """Whether the mesh (as repaired, if asked for) is sound, a text for a reader, and the facts.

    Parameters
    ----------
    file : str
    gap, n_bubbles : optional
        See `warpedfoam.surfaces.mesh_report`.
    repair : str, optional
        Where to write the repaired mesh; it is written only if it can be read again as sound.
    """
    mesh = read_mesh(file)
    report = mesh_report(mesh, gap=gap, n_bubbles=n_bubbles)
    lines = [_described(file, report)]
    facts: dict[str, Any] = {"file": file, "sound": report.sound, **_plain(report)}
    sound = report.sound
    if repair is not None:
        from warpedfoam.io import write_mesh

        mended, done = repaired(mesh)
        after = mesh_report(mended, gap=gap, n_bubbles=n_bubbles)
        sound = after.sound
        facts["repair"] = {"done": list(done), "sound": after.sound, **_plain(after)}
        lines.append(f"repair    {', '.join(done) or 'nothing to do'}")
        lines.append(_described(repair if sound else "after repair", after))
        if sound:
            write_mesh(repair, mended)
            facts["repair"]["file"] = repair
            lines.append(f"written   {repair}")
        else:
            lines.append("not written: it would still carry no foam; mend it in a mesh editor")
    return sound, "\n".join(lines), facts


def _described(name: str, report: MeshReport) -> str:
    handles = (2 - report.euler_characteristic) // 2
    lines = [
        f"mesh      {name}: {report.n_nodes} nodes, {report.n_triangles} triangles, area {report.area:.6g}, "
        f"mean edge {report.mean_edge:.3g}, least angle {report.least_angle:.1f} degrees",
        f"topology  Euler characteristic {report.euler_characteristic}"
        + (f" (genus {handles})" if report.sound else "")
        + f", {report.components} component{'s' if report.components > 1 else ''}, {report.rims} rims",
    ]
    if report.curvature_range is not None:
        low, high = report.curvature_range
        room = f"gaps up to {-1.0 / low:.3g} do not fold" if low < 0.0 else "no gap folds"
        lines.append(f"curvature {low:.4g} to {high:.4g} on the smooth surface; {room}")
    for finding in report.findings:
        kind = "FAULT" if finding.fatal else "note"
        lines.append(f"{kind:<9} {finding.fault} ({finding.count}, at {finding.where}): {finding.advice}")
    lines.append(f"verdict   {'can carry a foam' if report.sound else 'cannot carry a foam'}")
    return "\n".join(lines)


def _plain(report: MeshReport) -> dict[str, Any]:
    return asdict(report)
