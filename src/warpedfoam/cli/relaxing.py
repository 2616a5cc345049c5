"""``warpedfoam relax``: a saved foam relaxed anew, with other options."""

from __future__ import annotations

import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.cli.converting import read_foam
from warpedfoam.cli.folders import output_folder
from warpedfoam.cli.job import RECORD, Job, plain, results, write_foam
from warpedfoam.cli.progress import Progress
from warpedfoam.io import atomic_binary, versions, write_columns_csv, write_record
from warpedfoam.relax import LayeredRelaxation, Relaxation, relax

HISTORY, CURVES, BULGING = "history.csv", "relaxation.png", "bulging.npz"


def relax_file(
    file: str,
    *,
    frame: int,
    out: str,
    order: int | None,
    layers: int,
    t1: bool,
    tolerance: float,
    max_iterations: int,
    solver: str,
    color_by: str,
    picture: bool,
    progress: Progress,
) -> Job:
    """Relax the foam in ``file`` and write the files of the main job, and the history step by step.

    Raises
    ------
    ValueError, OSError
        If the file is no foam, an option is out of range, or the folder cannot be written or is the file's.
    """
    read = read_foam(file, frame)
    folder = output_folder(out)
    if (folder / "foam.npz").exists() and (folder / "foam.npz").samefile(file):
        raise ValueError(f"the folder {out} holds the foam to be read, {file}; choose another with -o")
    started, clock = datetime.now(UTC), time.perf_counter()
    relaxed = relax(
        read.foam,
        order=order,
        layers=layers,
        t1=t1,
        tolerance=tolerance,
        max_iterations=max_iterations,
        solver=solver,
        progress=progress,
    )
    seconds = time.perf_counter() - clock
    paths = write_foam(folder, relaxed, color_by=color_by, picture=picture, progress=progress)
    paths |= _write_history(folder, relaxed, picture=picture)
    options = {
        "order": relaxed.foam.order,
        "layers": layers,
        "t1": t1,
        "tolerance": tolerance,
        "max_iterations": max_iterations,
        "solver": solver,
    }
    record = plain(
        {
            "source": file,
            **results(read.foam, relaxed),
            **_bulging(relaxed),
            "timings": {"relax": seconds, "relax_parts": dict(relaxed.timings)},
            "started": started.isoformat(timespec="seconds"),
            "seed": read.foam.seed,
            "options": options,
            "versions": dict(versions()),
            "command": sys.argv,
            "outputs": {name: str(path) for name, path in paths.items()},
        }
    )
    write_record(folder / RECORD, record)
    progress("write", 1.0)
    return Job(relaxed, record)


def _write_history(folder: Path, relaxed: Relaxation, *, picture: bool) -> dict[str, Path]:
    history = relaxed.history
    paths = {"history": folder / HISTORY}
    write_columns_csv(paths["history"], {name: np.asarray(values) for name, values in vars(history).items()})
    if picture and len(history.iteration):
        from warpedfoam.plot import plot_relaxation, save_figure

        paths["curves"] = save_figure(folder / CURVES, plot_relaxation(relaxed))
    else:
        (folder / CURVES).unlink(missing_ok=True)
    if isinstance(relaxed, LayeredRelaxation):
        paths["bulging"] = folder / BULGING
        with atomic_binary(paths["bulging"]) as stream:
            np.savez(
                stream,
                heights=relaxed.heights,
                vertex_lines=relaxed.vertex_lines,
                film_points=relaxed.film_points,
                pressures=relaxed.pressures,
            )
    else:
        (folder / BULGING).unlink(missing_ok=True)
    return paths


def _bulging(relaxed: Relaxation) -> dict[str, Any]:
    if not isinstance(relaxed, LayeredRelaxation):
        return {}
    return {
        "layers": relaxed.layers,
        "ruled_energy": relaxed.ruled_energy,
        "contact_error": relaxed.contact_error,
    }


def summary_text(record: Any) -> str:
    """A few lines for a reader."""
    state = "converged" if record["converged"] else "NOT CONVERGED"
    lines = [
        f"foam      {record['n_bubbles']} bubbles from {record['source']}, films of order "
        f"{record['options']['order']}",
        f"state     {state} after {record['iterations']} steps and {record['n_t1']} T1s, "
        f"residual {_number(record['residual'])}, volume error {_number(record['volume_error'])}",
        f"energy    {_number(record['energy'], 10)}, from {_number(record['energy_start'], 10)}",
    ]
    if "ruled_energy" in record:
        lines.append(
            f"bulging   {record['layers']} layers: {_number(record['ruled_energy'], 10)} with ruled films, "
            f"contact angles off by {_number(record['contact_error'])} rad at most"
        )
    lines += [
        f"time      {record['timings']['relax']:.1f} s relaxing",
        f"written   {', '.join(record['outputs'].values())}",
    ]
    return "\n".join(lines)


def _number(value: float | None, digits: int = 2) -> str:
    return "unknown" if value is None else f"{value:.{digits}g}"
