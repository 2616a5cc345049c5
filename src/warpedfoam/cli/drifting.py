"""``warpedfoam drift``: a foam in time, by friction; trajectory, energy, pictures."""

from __future__ import annotations

import sys
import time
from datetime import UTC, datetime
from typing import Any

from warpedfoam.cli.converting import read_foam
from warpedfoam.cli.folders import output_folder
from warpedfoam.cli.progress import Progress
from warpedfoam.io import save, versions, write_columns_csv, write_record
from warpedfoam.motion import drift

FOAM, TRAJECTORY, ENERGY, PICTURE, ANIMATION, RECORD = (
    "foam.npz", "drift.h5", "energy.csv", "drift.png", "drift.gif", "drift.json",
)  # fmt: skip


def drift_file(
    file: str,
    *,
    frame: int,
    out: str,
    options: dict[str, Any],
    resume: bool,
    picture: bool,
    animation: bool,
    color_by: str,
    progress: Progress,
) -> dict[str, Any]:
    """Let the foam of a file drift, write everything to ``out``, and return the facts.

    ``options`` are those of `warpedfoam.drift`.
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
    moved = drift(start, trajectory=folder / TRAJECTORY, resume=resume, progress=progress, **options)
    seconds = time.perf_counter() - clock
    save(folder / FOAM, moved.foam)
    columns = {
        "time": moved.step_times,
        "energy": moved.step_energies,
        "dissipation": moved.step_dissipation,
        "error": moved.step_errors,
    }
    write_columns_csv(folder / ENERGY, columns)
    names = [TRAJECTORY, ENERGY, FOAM]
    for wanted, name in ((picture, PICTURE), (animation, ANIMATION)):
        if not wanted:
            (folder / name).unlink(missing_ok=True)
            continue
        from warpedfoam.plot import animate, plot_drift, save_figure

        if name == PICTURE:
            save_figure(folder / name, plot_drift(moved, color_by=color_by))
        else:
            progress("animation", 0.0)
            animate(moved, folder / name, color_by=color_by)
        names.append(name)
    facts = {
        "file": file,
        "options": options,
        "completed": moved.completed,
        "message": moved.message,
        "time": float(moved.times[-1]),
        "steps": moved.n_steps,
        "rejected": moved.n_rejected,
        "t1": moved.n_t1,
        "frames": len(moved.foams),
        "energy_first": float(moved.energies[0]),
        "energy_last": float(moved.energies[-1]),
        "volume_error": float(moved.volume_errors.max()) if options["hold_volumes"] else None,
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
            f"drift     {facts['message']}",
            f"energy    {facts['energy_first']:.9g} to {facts['energy_last']:.9g}",
            f"time      {facts['seconds']:.1f} s",
            f"written   {', '.join(facts['outputs'])}",
        ]
    )
