"""``warpedfoam cluster``: an open cluster relaxed, or its energy against where it is held."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.analysis import cluster_charges
from warpedfoam.arrays import Floats, as_integer, as_number
from warpedfoam.cell import HeleShawCell
from warpedfoam.cli.folders import output_folder
from warpedfoam.cli.partition import surface_options
from warpedfoam.cli.progress import Progress
from warpedfoam.foam import Foam
from warpedfoam.io import (
    save,
    versions,
    write_bubbles_csv,
    write_columns_csv,
    write_films_csv,
    write_ply,
    write_record,
)
from warpedfoam.io.atomic import writable_path
from warpedfoam.relax import outline_gap, relax
from warpedfoam.studies import ClusterPotential, cluster_foam, cluster_potential
from warpedfoam.surfaces import Torus

TABLE, CURVES, RECORD = "cluster_potential.csv", "cluster_potential.png", "cluster.json"


@dataclass(frozen=True)
class Given:
    """The options of the command, as they were typed."""

    n_bubbles: str
    gap: float
    volume: float
    centre: Sequence[str]
    orientation: float
    layout: str
    seed: int
    order: int
    contacts: bool
    places: int


def relaxed_cluster(
    surface: str, sizes: Sequence[str], given: Given, *, out: str, picture: bool, progress: Progress
) -> dict[str, Any]:
    """Build and relax, write the foam and a record to ``out``, and return the facts.

    Raises
    ------
    ValueError, OSError
        Options that make no cluster; a folder that cannot be written.
    """
    cell, about = _cell(surface, sizes, given)
    folder, record, started, clock = _begin(out)
    start = cluster_foam(
        cell,
        _counts(given.n_bubbles),
        volumes=as_number(given.volume, "--volume", positive=True),
        layout=given.layout,
        centre=_centres(given.centre),
        orientation=np.radians(given.orientation),
        order=given.order,
        seed=given.seed if given.layout == "random" else None,
    )
    relaxed = relax(start, contacts=given.contacts, progress=progress)
    seconds = time.perf_counter() - clock
    foam = relaxed.foam
    outputs = list(map(str, write_ply(folder / "foam.ply", foam)))
    for name, write in (
        ("bubbles.csv", write_bubbles_csv),
        ("films.csv", write_films_csv),
        ("foam.npz", save),
    ):
        write(folder / name, foam)
        outputs.append(str(folder / name))
    if picture:
        from warpedfoam.plot import save_picture

        title = None if relaxed.converged else f"NOT CONVERGED: {foam.n_bubbles - 1} bubbles"
        outputs.append(str(save_picture(folder / "foam.png", foam, view=_towards(foam), title=title)))
    else:
        (folder / "foam.png").unlink(missing_ok=True)
    gap = outline_gap(foam)
    assert foam.exterior is not None
    facts = {
        **about,
        "converged": relaxed.converged,
        "message": relaxed.message,
        "iterations": relaxed.iterations,
        "residual": float(relaxed.residual) if np.isfinite(relaxed.residual) else None,
        "volume_error": float(relaxed.volume_error) if np.isfinite(relaxed.volume_error) else None,
        "energy": relaxed.energy,
        "energy_start": start.energy,
        "n_t1": relaxed.n_t1,
        "contacts": [asdict(event) for event in relaxed.contacts],
        "bubbles": foam.n_bubbles - 1,
        "exterior": foam.exterior,
        "exterior_euler": int(foam.network.bubble_euler[foam.exterior]),
        "sum_of_charges": int(cluster_charges(foam).sum()),
        "outline_gap": gap if np.isfinite(gap) else None,
        "seconds": seconds,
    }
    return _written(record, started, facts, outputs)


def measure(
    surface: str, sizes: Sequence[str], given: Given, *, out: str, picture: bool, progress: Progress
) -> dict[str, Any]:
    """Hold one cluster at places, write table, picture and record, and return the facts.

    Raises
    ------
    ValueError, OSError
        Options that make no cluster, several clusters, places that cannot be had.
    ConvergenceError
        If the cluster does not come to rest where it is held.
    """
    cell, about = _cell(surface, sizes, given)
    counts = _counts(given.n_bubbles)
    if len(counts) > 1:
        raise ValueError(f"--potential is for one cluster, but -n says {given.n_bubbles}")
    if given.centre:
        raise ValueError("--potential holds the cluster at --places; leave out --centre")
    places = as_integer(given.places, "--places", minimum=2, maximum=10_000)
    folder, record, started, clock = _begin(out)
    points = _places(cell, places)
    found = cluster_potential(
        cell,
        counts[0],
        volumes=as_number(given.volume, "--volume", positive=True),
        points=points,
        layout=given.layout,
        orientation=np.radians(given.orientation),
        order=given.order,
        seed=given.seed if given.layout == "random" else None,
        progress=progress,
    )
    seconds = time.perf_counter() - clock
    outputs = [str(write_columns_csv(folder / TABLE, _columns(found)))]
    if picture:
        from warpedfoam.plot import plot_cluster_potential, save_figure

        outputs.append(str(save_figure(folder / CURVES, plot_cluster_potential(found))))
    else:
        (folder / CURVES).unlink(missing_ok=True)
    least, most = int(found.energies.argmin()), int(found.energies.argmax())
    facts = {
        **about,
        "converged": bool(found.minima.all()),
        "message": "" if found.minima.all() else "at some places the energy is no minimum",
        "places": places,
        "least_energy": float(found.energies[least]),
        "least_at": found.points[least].tolist(),
        "greatest_energy": float(found.energies[most]),
        "greatest_at": found.points[most].tolist(),
        "difference": float(found.energies[-1] - found.energies[0]),
        "greatest_force": float(np.linalg.norm(found.forces, axis=1).max()),
        "seconds": seconds,
    }
    return _written(record, started, facts, outputs)


def _cell(surface: str, sizes: Sequence[str], given: Given) -> tuple[HeleShawCell, dict[str, Any]]:
    chosen = surface_options(surface, sizes)
    cell = HeleShawCell(chosen.build(), as_number(given.gap, "--gap", positive=True))
    about = {"surface": {"kind": chosen.kind, **chosen.sizes}, "options": asdict(given)}
    return cell, about


def _begin(out: str) -> tuple[Path, Path, datetime, float]:
    folder = output_folder(out)
    record = writable_path(folder / RECORD)
    record.unlink(missing_ok=True)
    return folder, record, datetime.now(UTC), time.perf_counter()


def _written(record: Path, started: datetime, facts: dict[str, Any], outputs: list[str]) -> dict[str, Any]:
    facts = {
        **facts,
        "started": started.isoformat(timespec="seconds"),
        "versions": dict(versions()),
        "command": sys.argv,
        "outputs": [*outputs, str(record)],
    }
    write_record(record, facts)
    return facts


def _counts(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"-n {text}: write one number, or several with commas, such as 7,3") from None


def _centres(texts: Sequence[str]) -> Floats | None:
    if not texts:
        return None
    try:
        found = np.array([[float(part) for part in text.split(",")] for text in texts])
    except ValueError:
        found = np.zeros(0)
    if found.ndim != 2 or found.shape[1] != 3:
        raise ValueError(f"--centre {' '.join(texts)}: write three numbers with commas, such as 24,0,0")
    return found


def _places(cell: HeleShawCell, count: int) -> Floats:
    """On a torus from the outer equator over the top to the inner one; elsewhere all over the surface."""
    surface = cell.surface
    if isinstance(surface, Torus):
        return surface.points(np.linspace(0.0, np.pi, count), np.zeros(count))
    return surface.lattice_points(count)


def _towards(foam: Foam) -> tuple[float, float] | None:
    """Elevation and azimuth of the first bubble's normal, so that the cluster is seen."""
    surface = foam.cell.surface
    if surface.period is not None:
        return None
    x, y, z = surface.normals(foam.bubble_centres[:1])[0]
    # a little from above, where there is less in the way
    up = float(np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))))
    return float(np.clip(0.6 * up + 25.0, -80.0, 80.0)), float(np.degrees(np.arctan2(y, x)))


def _columns(found: ClusterPotential) -> dict[str, Any]:
    surface = found.foams[0].cell.surface
    table: dict[str, Any] = {axis: found.points[:, k] for k, axis in enumerate("xyz")}
    if isinstance(surface, Torus):
        table["phi_degrees"] = np.degrees(surface.angles(found.points)[0])
    table["gaussian_curvature"] = surface.gaussian_curvature(found.points)
    table["energy"] = found.energies
    table |= {f"force_{axis}": found.forces[:, k] for k, axis in enumerate("xyz")}
    if isinstance(surface, Torus):
        up = surface.vertex_frames(found.points)[:, 0]
        table["force_along_phi"] = np.einsum("nx,nx->n", found.forces, up)
    table["orientation_degrees"] = np.degrees(found.orientations)
    table["torque"] = found.torques
    table["residual"] = found.residuals
    table["minimum"] = found.minima.astype(np.int64)
    return table


def summary_text(facts: dict[str, Any]) -> str:
    """A few lines for a reader."""
    options, surface = facts["options"], dict(facts["surface"])
    kind = surface.pop("kind")
    told = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in surface.items())
    lines = [
        f"cluster   {options['n_bubbles']} bubbles of volume {options['volume']:g}, gap {options['gap']:g}, "
        f"on a {kind}" + (f" ({told})" if told else "")
    ]
    if "places" in facts:
        low, high = ([round(float(x), 3) for x in facts[key]] for key in ("least_at", "greatest_at"))
        lines += [
            f"energy    from {facts['least_energy']:.10g} at {low} to {facts['greatest_energy']:.10g} "
            f"at {high}",
            f"places    {facts['places']}, last minus first {facts['difference']:.9g}, force up to "
            f"{facts['greatest_force']:.3g}",
        ]
    else:
        state = "converged" if facts["converged"] else "NOT CONVERGED"
        kinds = [event["kind"] for event in facts["contacts"]]
        lines += [
            f"state     {state} after {facts['iterations']} steps, {facts['n_t1']} T1s, "
            f"{kinds.count('join')} joins, {kinds.count('part')} partings",
            f"energy    {facts['energy']:.10g}",
            f"exterior  Euler number {facts['exterior_euler']}; charges add up to {facts['sum_of_charges']}",
        ]
    lines += [f"time      {facts['seconds']:.1f} s", f"written   {', '.join(facts['outputs'])}"]
    return "\n".join(lines)
