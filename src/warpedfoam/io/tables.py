"""Tables of bubbles and films as CSV, one row each, numbers in full precision."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Floats, as_instance
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path

Columns = dict[str, list[Any]]


def write_bubbles_csv(path: PathLike, foam: Foam) -> Path:
    """Write one row per bubble.

    Columns: ``id``; ``x, y, z`` of its centre; ``sides``; ``charge``; ``area`` and ``volume``;
    ``pressure`` (blank if the foam has none); ``energy_share``, half the energy of its films;
    ``gaussian_curvature``, the mean over the bubble. The energy shares add up to the foam's energy.

    Parameters
    ----------
    path : str or path
    foam : Foam

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam.
    FileNotFoundError, IsADirectoryError, ValueError
        If the path cannot be written.
    """
    target = writable_path(path)
    return _write(target, bubble_columns(foam))


def bubble_columns(foam: Foam) -> Columns:
    """The columns of `write_bubbles_csv`; pressures that are not there are None."""
    network = as_instance(foam, "foam", Foam).network
    x, y, z = foam.bubble_centres.T
    return {
        "id": foam.bubble_ids.tolist(),
        "x": x.tolist(),
        "y": y.tolist(),
        "z": z.tolist(),
        "sides": network.sides.tolist(),
        "charge": network.charges.tolist(),
        "area": foam.bubble_areas.tolist(),
        "volume": foam.bubble_volumes.tolist(),
        "pressure": _or_none(foam.pressures, foam.n_bubbles),
        "energy_share": _energy_shares(foam).tolist(),
        "gaussian_curvature": (foam.bubble_curvatures / foam.bubble_areas).tolist(),
    }


def write_films_csv(path: PathLike, foam: Foam) -> Path:
    """Write one row per film.

    Columns: ``film``; ``left`` and ``right``, the ids of the bubbles beside it; ``tail`` and ``head``,
    the vertices where it starts and ends; ``length`` on the inner plate; ``area`` between the plates;
    ``pressure_jump``, left minus right (blank if the foam has no pressures); ``x, y, z`` of its middle.

    Parameters
    ----------
    path : str or path
    foam : Foam

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError, OSError
        As `write_bubbles_csv`.
    """
    target = writable_path(path)
    return _write(target, film_columns(foam))


def film_columns(foam: Foam) -> Columns:
    """The columns of `write_films_csv`; pressure jumps that are not there are None."""
    network = as_instance(foam, "foam", Foam).network
    x, y, z = foam.film_curves_at(np.array([0.5]))[:, 0].T
    jump = None if foam.pressures is None else foam.pressures[network.left] - foam.pressures[network.right]
    return {
        "film": list(range(network.n_films)),
        "left": foam.bubble_ids[network.left].tolist(),
        "right": foam.bubble_ids[network.right].tolist(),
        "tail": network.tails.tolist(),
        "head": network.heads.tolist(),
        "length": foam.film_lengths.tolist(),
        "area": foam.film_areas.tolist(),
        "pressure_jump": _or_none(jump, network.n_films),
        "x": x.tolist(),
        "y": y.tolist(),
        "z": z.tolist(),
    }


def write_columns_csv(path: PathLike, columns: Mapping[str, NDArray[Any]]) -> Path:
    """Write columns of equal length, such as `DefectReport.columns` gives, under their names.

    Parameters
    ----------
    path : str or path
    columns : mapping of str to (n,) array

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError
        If a column is no array of one axis, or columns differ in length.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.
    """
    target = writable_path(path)
    for name, values in columns.items():
        if not isinstance(values, np.ndarray) or values.ndim != 1:
            raise TypeError(f"columns[{name!r}] must be an array of one axis")
    if len({len(values) for values in columns.values()}) > 1:
        sizes = ", ".join(f"{name} {len(values)}" for name, values in columns.items())
        raise ValueError(f"columns must be of equal length, got {sizes}")
    return _write(target, {name: values.tolist() for name, values in columns.items()})


def _energy_shares(foam: Foam) -> Floats:
    """Half of each film's energy to the bubble on either side: both halves if they are one bubble."""
    halves: Floats = np.repeat(0.5 * foam.tension * foam.film_areas, 2)
    return np.bincount(foam.network.bubble, halves, minlength=foam.n_bubbles).astype(np.float64)


def _or_none(values: Floats | None, count: int) -> list[Any]:
    return [None] * count if values is None else values.tolist()


def _write(target: Path, columns: Columns) -> Path:
    with atomic_text(target) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return target
