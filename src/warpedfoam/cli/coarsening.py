"""``warpedfoam coarsen``: gas passes through the films of a foam; trajectory, table, pictures."""

from __future__ import annotations

import sys
import time
from datetime import UTC, datetime
from typing import Any

from warpedfoam.cli.converting import read_foam
from warpedfoam.cli.folders import output_folder
from warpedfoam.cli.progress import Progress
from warpedfoam.io import save, versions, write_columns_csv, write_record
from warpedfoam.motion import coarsen

FOAM, TRAJECTORY, TABLE, PICTURE, RECORD = (
    "foam.npz", "coarsen.h5", "coarsening.csv", "coarsening.png", "coarsen.json",
)  # fmt: skip


def coarsen_file(
    file: str,
    *,
    frame: int,
    out: str,
    options: dict[str, Any],
    resume: bool,
    picture: bool,
    progress: Progress,
) -> dict[str, Any]:
    """Let the foam of a file coarsen, write everything to ``out``, and return the facts.

    ``options`` are those of `warpedfoam.coarsen`.
    """
    start = read_foam(file, frame).foam
    folder = output_folder(out)
    record = folder / RECORD
    if (folder / TRAJECTORY).exists() and not resume:
        raise FileExistsError(
            f"{folder / TRAJECTORY} is there already: go on with it by --resume, or choose another folder"
        )
    record.unlink(missing_ok=True)
    started, clock = datetime.now(UTC), time.perf_counter()
    made = coarsen(start, trajectory=folder / TRAJECTORY, resume=resume, progress=progress, **options)
    seconds = time.perf_counter() - clock
    save(folder / FOAM, made.foam)
    columns = {
        "time": made.step_times,
        "bubbles": made.step_bubbles,
        "mean_area": made.step_mean_areas,
        "mu2": made.step_mu2,
        "energy": made.step_energies,
        "error": made.step_errors,
    }
    write_columns_csv(folder / TABLE, columns)
    names = [TRAJECTORY, TABLE, FOAM]
    if picture and made.n_steps:
        from warpedfoam.plot import plot_coarsening, save_figure

        save_figure(folder / PICTURE, plot_coarsening(made))
        names.append(PICTURE)
    else:
        (folder / PICTURE).unlink(missing_ok=True)
    facts = {
        "file": file,
        "options": options,
        "completed": made.completed,
        "message": made.message,
        "time": float(made.times[-1]),
        "steps": made.n_steps,
        "rejected": made.n_rejected,
        "t1": made.n_t1,
        "t2": made.n_t2,
        "frames": len(made.foams),
        "bubbles_first": int(made.step_bubbles[0]),
        "bubbles_last": int(made.step_bubbles[-1]),
        "mu2": float(made.step_mu2[-1]),
        "energy_first": float(made.step_energies[0]),
        "energy_last": float(made.step_energies[-1]),
        "seconds": seconds,
        "started": started.isoformat(timespec="seconds"),
        "versions": dict(versions()),
        "command": sys.argv,
        "outputs": [str(folder / name) for name in (*names, RECORD)],
    }
    write_record(record, facts)
    return facts


def summary_text(facts: dict[str, Any]) -> str:
    """A few lines for a reader."""
    return "\n".join(
        [
            f"coarsen   {facts['message']}",
            f"bubbles   {facts['bubbles_first']} to {facts['bubbles_last']}, mu2 {facts['mu2']:.3f}, "
            f"{facts['t1']} T1s",
            f"energy    {facts['energy_first']:.9g} to {facts['energy_last']:.9g}",
            f"time      {facts['seconds']:.1f} s",
            f"written   {', '.join(facts['outputs'])}",
        ]
    )
