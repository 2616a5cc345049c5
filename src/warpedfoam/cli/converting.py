"""``warpedfoam convert`` and ``warpedfoam info``: foams from file to file, and what a file holds."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam import io
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import writable_path

#: By ending: how a foam is written, and what the file is for.
WRITERS: dict[str, tuple[Callable[..., Any], str]] = {
    ".npz": (io.save, "the foam itself, bit for bit"),
    ".h5": (lambda path, foam: _trajectory(path, foam), "the foam itself, as a trajectory of one frame"),
    ".hdf5": (lambda path, foam: _trajectory(path, foam), "the same"),
    ".vtp": (io.write_vtp, "ParaView, and the foam itself"),
    ".vtm": (io.write_vtm, "ParaView, bubbles and films as blocks"),
    ".ply": (io.write_ply, "polygons with numbers, and a view file"),
    ".glb": (io.write_glb, "browsers, Blender, slides"),
    ".obj": (io.write_obj, "polygons and polylines"),
    ".graphml": (io.write_graphml, "the dual graph"),
    ".json": (io.write_graph_json, "the dual graph as node-link JSON"),
    ".csv": (io.write_bubbles_csv, "a row per bubble"),
    ".parquet": (io.write_bubbles_parquet, "a row per bubble"),
    ".fe": (io.write_fe, "Surface Evolver"),
}
_COLOURED = (".ply", ".glb")
TRAJECTORIES = (".h5", ".hdf5")


@dataclass(frozen=True)
class Read:
    """A foam from a file: which frame of how many, if it is a trajectory."""

    foam: Foam
    kind: str
    frame: int | None
    n_frames: int | None
    time: float | None


def read_foam(file: str, frame: int = -1) -> Read:
    """The foam in a ``.npz``, ``.vtp`` or HDF5 file; of a trajectory the frame asked for, or the last.

    Raises
    ------
    ValueError, OSError
        If the file cannot be read or has another ending.
    """
    ending = Path(file).suffix.lower()
    if ending == ".npz":
        return Read(io.load(file), "npz", None, None, None)
    if ending == ".vtp":
        return Read(io.read_vtp(file), "vtp", None, None, None)
    if ending in TRAJECTORIES:
        with io.Trajectory(file) as frames:
            if not -len(frames) <= frame < len(frames):
                raise ValueError(f"--frame {frame}: {file} holds {len(frames)} frames, numbered from 0")
            k = frame % len(frames)
            return Read(frames[k], "HDF5 trajectory", k, len(frames), float(frames.times[k]))
    raise ValueError(f"cannot read a foam from {file}: its name must end in .npz, .vtp, .h5 or .hdf5")


def convert(file: str, targets: list[str], *, color_by: str | None, frame: int) -> tuple[str, dict[str, Any]]:
    """Write the foam of ``file`` to each target, by its ending; a text and the facts.

    Raises
    ------
    ValueError, OSError, ImportError
        If a file cannot be read or written, an ending is not known, or a target is the source.
    """
    for target in targets:
        ending = Path(target).suffix.lower()
        if ending not in WRITERS:
            raise ValueError(f"cannot write {target}: its name must end in {', '.join(WRITERS)}")
        if color_by is not None and ending not in _COLOURED:
            raise ValueError(f"--color-by is for {' and '.join(_COLOURED)} files, not for {target}")
        if Path(target).exists() and Path(target).samefile(file):
            raise ValueError(f"cannot write {target}: it is the file to be read; choose another name")
    read = read_foam(file, frame)
    written: list[str] = []
    for target in targets:
        options = {} if color_by is None else {"color_by": color_by}
        done = WRITERS[Path(target).suffix.lower()][0](target, read.foam, **options)
        written += [str(path) for path in (done if isinstance(done, tuple) else (done,))]
    text = f"read      {_described(read, file)}\nwritten   {', '.join(written)}"
    return text, {"file": file, **_place(read), "written": written}


def info(file: str, *, frame: int) -> tuple[str, dict[str, Any]]:
    """What the foam in a file is: a text for a reader, and the facts.

    Raises
    ------
    ValueError, OSError, ImportError
        If the file cannot be read.
    """
    read = read_foam(file, frame)
    foam, network = read.foam, read.foam.network
    sides = {str(n): int(c) for n, c in enumerate(np.bincount(network.sides)) if c}
    off = np.abs(foam.bubble_volumes / foam.target_volumes - 1.0)[network.bubble_euler == 1]
    volume_error = float(off.max(initial=0.0))
    facts: dict[str, Any] = {
        "file": file,
        "kind": read.kind,
        **_place(read),
        "surface": type(foam.cell.surface).__name__,
        "euler_characteristic": foam.cell.surface.euler_characteristic,
        "area": float(foam.cell.surface.area),
        "gap": foam.cell.mean_gap,
        "tension": foam.tension,
        "seed": foam.seed,
        "order": foam.order,
        "n_bubbles": foam.n_bubbles,
        "n_films": network.n_films,
        "n_vertices": network.n_vertices,
        "n_markers": len(network.markers),
        "sides": sides,
        "sum_of_charges": int(network.charges.sum()),
        "energy": foam.energy,
        "film_length": float(foam.film_lengths.sum()),
        "volume": float(foam.cell.volume),
        "volume_error": volume_error,
        "pressures": foam.pressures is not None,
    }
    told = "   ".join(f"{n}: {count}" for n, count in sides.items())
    lines = [
        f"foam      {_described(read, file)}",
        f"cell      {facts['surface']} of area {facts['area']:.6g} and Euler characteristic "
        f"{facts['euler_characteristic']}, {'' if foam.cell.parallel else 'mean '}gap {foam.cell.mean_gap:g}",
        f"network   {network.n_films} films, {network.n_vertices} vertices"
        + (f", {facts['n_markers']} of them markers" if facts["n_markers"] else ""),
        f"sides     {told}   (charges add up to {facts['sum_of_charges']})",
        f"energy    {foam.energy:.10g}, films {facts['film_length']:.6g} long, order {foam.order}, "
        f"tension {foam.tension:g}",
        f"volumes   {facts['volume']:.6g} in all, off their targets by {volume_error:.1e} at most, relative",
        f"pressures {'known: it was relaxed' if facts['pressures'] else 'none: it has not been relaxed'}",
        f"seed      {'none' if foam.seed is None else foam.seed}",
    ]
    return "\n".join(lines), facts


def _trajectory(path: str, foam: Foam) -> Path:
    """A trajectory of one frame in place of what is there, whole or not at all."""
    target = writable_path(path)
    part = target.with_name(f".{target.stem}.{secrets.token_hex(6)}{target.suffix}")
    try:
        with io.TrajectoryWriter(part) as writer:
            writer.append(foam)
        os.replace(part, target)
    except BaseException as fault:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        if isinstance(fault, OSError) and fault.errno is not None:
            raise OSError(fault.errno, fault.strerror, str(target)) from None
        raise
    return target


def _place(read: Read) -> dict[str, Any]:
    if read.frame is None:
        return {}
    return {"frame": read.frame, "n_frames": read.n_frames, "time": read.time}


def _described(read: Read, file: str) -> str:
    where = "" if read.frame is None else f", frame {read.frame} of {read.n_frames} at time {read.time:g}"
    return f"{file} ({read.kind}{where}): {read.foam.n_bubbles} bubbles"
