"""Statistics by number of sides: Aboav–Weaire, Lewis, areas and pressures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from warpedfoam.analysis.correlations import as_foams
from warpedfoam.arrays import Bools, Floats, Ints, frozen
from warpedfoam.foam import Foam


@dataclass(frozen=True, eq=False)
class FoamStatistics:
    """Statistics of the bubbles of one foam or of several together; arrays (k,) go by ``sides``.

    Attributes
    ----------
    sides, counts : (k,) integer arrays
        The numbers of sides n that occur, ascending, and how many bubbles have each.
    fractions : (k,) array
        P(n).
    neighbour_sides : (k,) array
        m(n): mean number of sides of the bubbles across the films of n-sided ones, each film counted.
    area_by_sides : (k,) array
        Mean area of n-sided bubbles over the mean area of all.
    pressure_by_sides : (k,) array or None
        Mean pressure of n-sided bubbles; None if a foam has no pressures.
    mean_sides, mu2 : float
        ⟨n⟩ and μ₂ = ⟨(n − ⟨n⟩)²⟩.
    aboav : float or None
        a of the Aboav–Weaire law n m(n) = (⟨n⟩ − a) n + ⟨n⟩ a + μ₂, by least squares over all films'
        sides; None if all bubbles have equally many.
    lewis : float or None
        Slope λ of Lewis's law ⟨A⟩_n / ⟨A⟩ = 1 + λ (n − ⟨n⟩), by least squares over all bubbles.
    area_deviation : float
        Standard deviation of the areas over their mean.
    pressure_deviation : float or None
        Standard deviation of the pressures.
    n_bubbles : int
    at_walls : (k,) integer array
        How many of the n-sided bubbles are at walls, where a wall counts as a side and the charge is not
        6 − n.
    """

    sides: Ints
    counts: Ints
    fractions: Floats
    neighbour_sides: Floats
    area_by_sides: Floats
    pressure_by_sides: Floats | None
    mean_sides: float
    mu2: float
    aboav: float | None
    lewis: float | None
    area_deviation: float
    pressure_deviation: float | None
    n_bubbles: int
    at_walls: Ints


def foam_statistics(foams: Foam | Iterable[Foam]) -> FoamStatistics:
    """Statistics of sides, areas and pressures, bubbles of all foams taken together.

    Weaire's sum rule Σ P(n) n m(n) = ⟨n²⟩ = μ₂ + ⟨n⟩² holds exactly on closed surfaces. Exteriors of clusters
    are left out, films that border them too.

    Parameters
    ----------
    foams : Foam or iterable of Foam
        Areas are taken relative to each foam's mean area.

    Raises
    ------
    TypeError
        If there is no foam.

    References
    ----------
    D. Weaire, Metallography 7, 157 (1974), for the sum rule; D. A. Aboav, Metallography 3, 383 (1970);
    F. T. Lewis, Anat. Rec. 38, 341 (1928).

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> found = foam_statistics(voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=80, seed=1))
    >>> rule = float((found.fractions * found.sides * found.neighbour_sides).sum())
    >>> abs(rule - found.mu2 - found.mean_sides**2) < 1e-9
    True
    """
    members = as_foams(foams)
    parts = [_of_one(foam) for foam in members]
    n, area = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
    near, far, walled = (np.concatenate([p[k] for p in parts]) for k in (3, 4, 5))
    pressure = (
        np.concatenate([p[2] for p in parts if p[2] is not None])
        if all(p[2] is not None for p in parts)
        else None
    )
    sides, place, counts = np.unique(n, return_inverse=True, return_counts=True)
    mean, mu2 = float(n.mean()), float(n.var())
    seat = np.searchsorted(sides, near)
    films = np.bincount(seat, minlength=len(sides))
    neighbour = np.bincount(seat, far, len(sides)) / np.maximum(films, 1)
    varied = mu2 > 0.0
    return FoamStatistics(
        frozen(sides),
        frozen(counts),
        frozen(counts / len(n)),
        frozen(neighbour),
        frozen(np.bincount(place, area) / counts),
        None if pressure is None else frozen(np.bincount(place, pressure) / counts),
        mean,
        mu2,
        _aboav(sides, counts, neighbour, mean, mu2) if varied else None,
        float(((n - mean) * (area - 1.0)).mean() / mu2) if varied else None,
        float(area.std()),
        None if pressure is None else float(pressure.std()),
        len(n),
        frozen(np.bincount(place, walled, len(sides)).astype(np.int64)),
    )


def _aboav(sides: Ints, counts: Ints, neighbour: Floats, mean: float, mu2: float) -> float:
    """Least squares for a in n m(n) − ⟨n⟩ n − μ₂ = −a (n − ⟨n⟩), each bubble once."""
    x = sides - mean
    y = sides * neighbour - mean * sides - mu2
    return float(-(counts * x * y).sum() / (counts * x * x).sum())


def _of_one(foam: Foam) -> tuple[Ints, Floats, Floats | None, Ints, Ints, Bools]:
    """Of the disks sides, relative areas and pressures; sides on both sides of each film; who is at walls."""
    network = foam.network
    inside = network.bubble_euler == 1
    n, area = network.sides[inside], foam.bubble_areas[inside]
    pressure = None if foam.pressures is None else foam.pressures[inside]
    # a film in several pieces counts once from either end: by the piece that starts at no marker
    halves = np.flatnonzero(
        inside[network.bubble]
        & inside[network.bubble.reshape(-1, 2)[:, ::-1].ravel()]
        & (network.vertex_degrees[network.origin] != 2)
    )
    near, far = network.sides[network.bubble[halves]], network.sides[network.bubble[halves ^ 1]]
    return n, area / float(area.mean()), pressure, near, far, network.wall_counts[inside] > 0
