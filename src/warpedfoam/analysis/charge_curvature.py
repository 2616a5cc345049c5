"""Charge inside regions against the curvature that they enclose, with error bars over ensembles."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.analysis.correlations import as_foams
from warpedfoam.arrays import Bools, Floats, Ints, as_floats, as_instance, as_integer, frozen
from warpedfoam.foam import Foam
from warpedfoam.surfaces.protocol import Layer, Surface

#: A number for every point (n, 3) of a surface.
Coordinate = Callable[[Floats], ArrayLike]


@dataclass(frozen=True, eq=False)
class ChargeProfile:
    """Charge in bands against curvature; arrays (k,) by band.

    Attributes
    ----------
    edges : (k + 1,) array
        Of the bands, in the coordinate.
    bubbles : (k,) array
        Mean number of bubbles whose centre lies in the band.
    charge : (k,) array
        Their total charge Q, mean over the foams.
    charge_error : (k,) array or None
        Standard error of that mean; None for a single foam.
    curvature : (k,) array
        (3/π) Σ ∫_i G dA over these same bubbles, mean over the foams.
    difference_error : (k,) array or None
        Standard error of the mean of charge − curvature.
    region_curvature : (k,) array
        (3/π) ∫ G dA over the band itself.
    charges : (n_foams, k) integer array
        Q of each foam.
    """

    edges: Floats
    bubbles: Floats
    charge: Floats
    charge_error: Floats | None
    curvature: Floats
    difference_error: Floats | None
    region_curvature: Floats
    charges: Ints


@dataclass(frozen=True, eq=False)
class ChargeEnergies:
    """Energies of foams against where their charges sit; arrays (n_foams,).

    Attributes
    ----------
    placement : (n_foams,) array
        Σ_i q_i f(x_i), the coordinate f weighted by charge.
    spread : (n_foams,) array
        Σ_i |q_i|, the number of charges of either sign.
    energies : (n_foams,) array
        E of each foam over the mean of all.
    slope, slope_error : float
        Least squares of energy against placement at equal spread: dE/d(placement), and its standard error.
    spread_slope, spread_slope_error : float
        The same against spread, at equal placement.
    """

    placement: Floats
    spread: Floats
    energies: Floats
    slope: float
    slope_error: float
    spread_slope: float
    spread_slope_error: float


def charge_profile(
    foams: Foam | Iterable[Foam],
    coordinate: Coordinate,
    edges: ArrayLike,
    *,
    n_nodes: int = 20_000,
) -> ChargeProfile:
    """Charge of the bubbles in bands of a coordinate, against the curvature of bubbles and bands.

    Two curvatures belong to a band. By Gauss–Bonnet every bubble has
    q_i = (3/π)(∫_i G dA + Σ_j (p_i − p_j) ℓ_ij/γ) at a thin gap, so Q of a set of bubbles differs from
    (3/π) Σ ∫_i G dA over *these bubbles* (``curvature``) only by what the pressures do along the set's
    rim. The band itself (``region_curvature``) cuts bubbles in two, and a bubble belongs to the band
    that holds its centre: for a single foam the two differ by a bubble's share at the rim, on average
    over an ensemble they agree but for terms of the order of the bubble size over the radius of
    curvature.

    Parameters
    ----------
    foams : Foam or iterable of Foam
        An ensemble on one surface.
    coordinate : callable
        From points (n, 3) to numbers (n,): an angle, a height, a distance, or 0 and 1 outside and inside.
    edges : (k + 1,) array
        Ascending; a band holds its lower edge, the last one also its upper edge.
    n_nodes : int, optional
        Of the mesh on which G is integrated over the bands; 0 integrates the bubbles' curvatures
        alone and leaves ``region_curvature`` at 0.

    Returns
    -------
    ChargeProfile

    Raises
    ------
    TypeError, ValueError
        No foam, foams on different surfaces, a coordinate that is no function or whose values are not
        one finite number a point, or edges that do not ascend.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=60, seed=1)
    >>> found = charge_profile(foam, lambda x: x[:, 2], [-1.0, 0.0, 1.0])
    >>> found.charges.sum(), found.region_curvature.round(2).tolist()
    (np.int64(12), [6.0, 6.0])
    """
    members = as_foams(foams)
    surface = members[0].cell.surface
    if any(foam.cell.surface is not surface and foam.cell.surface != surface for foam in members):
        raise ValueError("foams must lie on one surface; compare surfaces by one profile each")
    bounds = as_floats(edges, "edges", (None,))
    if len(bounds) < 2 or (np.diff(bounds) <= 0.0).any():
        raise ValueError("edges must hold at least two numbers, ascending")
    nodes = as_integer(n_nodes, "n_nodes", minimum=0)
    bands = len(bounds) - 1
    bubbles, charges, curvatures = (np.zeros((len(members), bands)) for _ in range(3))
    for row, foam in enumerate(members):
        band = _bands(_values(coordinate, foam.bubble_centres), bounds)
        band[foam.network.bubble_euler != 1] = bands
        for table, weights in (
            (bubbles, np.ones(foam.n_bubbles)),
            (charges, foam.network.charges),
            (curvatures, (3.0 / np.pi) * foam.bubble_curvatures),
        ):
            table[row] = np.bincount(band, weights, bands + 1)[:bands]
    region = np.zeros(bands)
    if nodes:
        region = (3.0 / np.pi) * band_curvatures(surface, coordinate, bounds, n_nodes=nodes)
    return ChargeProfile(
        frozen(bounds),
        frozen(bubbles.mean(axis=0)),
        frozen(charges.mean(axis=0)),
        _standard_error(charges),
        frozen(curvatures.mean(axis=0)),
        _standard_error(charges - curvatures),
        frozen(region),
        frozen(np.round(charges).astype(np.int64)),
    )


def charge_in(foam: Foam, inside: Callable[[Floats], ArrayLike]) -> tuple[int, float]:
    """Charge of the bubbles with centre in a region, and (3/π) Σ ∫ G dA of the same bubbles.

    Parameters
    ----------
    foam : Foam
    inside : callable
        From points (n, 3) to booleans (n,).

    Raises
    ------
    TypeError, ValueError
        If ``foam`` is not a Foam or ``inside`` does not say yes or no for every point.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=60, seed=1)
    >>> charge, curvature = charge_in(foam, lambda x: x[:, 0] < 2.0)
    >>> charge, round(curvature, 6)
    (12, 12.0)
    """
    as_instance(foam, "foam", Foam)
    if not callable(inside):
        raise TypeError(f"inside must be a function of points, got {type(inside).__name__}")
    chosen = np.asarray(inside(foam.bubble_centres))
    if chosen.dtype != np.bool_ or chosen.shape != (foam.n_bubbles,):
        raise ValueError(
            "inside must return one True or False per point, "
            f"got {chosen.dtype} values of shape {chosen.shape}"
        )
    disks: Bools = chosen & (foam.network.bubble_euler == 1)
    return int(foam.network.charges[disks].sum()), 3.0 / np.pi * float(foam.bubble_curvatures[disks].sum())


def band_curvatures(
    surface: Surface, coordinate: Coordinate, edges: ArrayLike, *, n_nodes: int = 20_000
) -> Floats:
    """∫ G dA over bands of a coordinate, (k,).

    On a mesh: G at the triangles' middles times their areas, each triangle shared among the bands as a
    linear coordinate between its nodes cuts it. Triangles over which an angle jumps go to the band of
    their middle. The total is set right by `Surface.integral`. The error falls with the square of the
    mesh width: about 3e-4 of 4π on tori with 20 000 nodes.

    Raises
    ------
    TypeError, ValueError
        As `charge_profile`.

    Examples
    --------
    >>> from warpedfoam import Torus
    >>> halves = band_curvatures(Torus(3.0, 1.0), lambda x: np.hypot(x[:, 0], x[:, 1]), [0.0, 3.0, 5.0])
    >>> (halves / np.pi).round(2).tolist()
    [-4.0, 4.0]
    """
    bounds = as_floats(edges, "edges", (None,))
    mesh = surface.triangulate(as_integer(n_nodes, "n_nodes", minimum=12))
    middles = surface.project(mesh.corners.mean(axis=1))
    parts = surface.gaussian_curvature(middles) * mesh.triangle_areas
    # what the mesh leaves over goes by |G|
    left = surface.integral(Layer.curvature()) - parts.sum()
    size = np.abs(parts)
    parts = parts + left * size / max(float(size.sum()), 1e-300)
    at_nodes = _values(coordinate, mesh.nodes)[mesh.triangles]
    at_middles = _values(coordinate, middles)
    jumps = np.ptp(at_nodes, axis=1) > 0.5 * (bounds[-1] - bounds[0])
    at_nodes = np.where(jumps[:, None], at_middles[:, None], at_nodes)
    below = np.array([float((parts * _share_below(at_nodes, edge)).sum()) for edge in bounds])
    # the last band has its upper edge
    below[-1] = float((parts * (1.0 - _share_below(-at_nodes, -bounds[-1]))).sum())
    return np.diff(below)


def charge_energies(foams: Iterable[Foam], coordinate: Coordinate) -> ChargeEnergies:
    """Energy of the foams of an ensemble against where their charges sit, and the slopes.

    The model is E/⟨E⟩ = c + slope · Σ q f(x) + spread_slope · Σ|q|: moving one charge by Δf at an equal
    number of charges changes the energy by slope · Δf.

    Parameters
    ----------
    foams : iterable of Foam
        At least five, relaxed, with equally many bubbles on one surface in one gap.
    coordinate : callable
        f, from points (n, 3) to numbers (n,).

    Raises
    ------
    TypeError, ValueError
        Fewer than five foams, foams that differ in number of bubbles or cell, or a coordinate that is
        no function.
    """
    members = as_foams(foams)
    if len(members) < 5:
        raise ValueError(f"charge_energies needs at least 5 foams for its 3 coefficients, got {len(members)}")
    first = members[0]
    for foam in members:
        if foam.n_bubbles != first.n_bubbles or (foam.cell is not first.cell and foam.cell != first.cell):
            raise ValueError("foams must have equally many bubbles in one cell, or energies mean nothing")
    charges = [np.where(f.network.bubble_euler == 1, f.network.charges, 0) for f in members]
    placement = np.array(
        [float(q @ _values(coordinate, f.bubble_centres)) for q, f in zip(charges, members, strict=True)]
    )
    spread = np.array([float(np.abs(q).sum()) for q in charges])
    energies = np.array([f.energy for f in members])
    energies /= energies.mean()
    design = np.stack([np.ones_like(spread), placement - placement.mean(), spread - spread.mean()], axis=1)
    inverse = np.linalg.pinv(design)
    slopes = inverse @ energies
    left = energies - design @ slopes
    errors = np.sqrt((left @ left) / (len(members) - 3) * np.diag(inverse @ inverse.T))
    return ChargeEnergies(
        frozen(placement), frozen(spread), frozen(energies),
        float(slopes[1]), float(errors[1]), float(slopes[2]), float(errors[2]),
    )  # fmt: skip


def _values(coordinate: Coordinate, points: Floats) -> Floats:
    if not callable(coordinate):
        raise TypeError(f"coordinate must be a function of points, got {type(coordinate).__name__}")
    return as_floats(np.asarray(coordinate(points), dtype=np.float64), "coordinate", (len(points),))


def _bands(values: Floats, edges: Floats) -> Ints:
    """Band of each value; the number of bands for those outside."""
    count = len(edges) - 1
    band = np.searchsorted(edges, values, side="right") - 1
    band[values == edges[-1]] = count - 1
    band[(band < 0) | (band >= count)] = count
    return band


def _standard_error(rows: Floats) -> Floats | None:
    if len(rows) < 2:
        return None
    return np.asarray(frozen(rows.std(axis=0, ddof=1) / np.sqrt(len(rows))))


def _share_below(values: Floats, level: float) -> Floats:
    """Share (m,) of each triangle's area where the linear function with corner ``values`` is below."""
    low, middle, high = np.sort(values, axis=1).T
    tiny = 1e-300
    start = (level - low) ** 2 / np.maximum((middle - low) * (high - low), tiny)
    end = 1.0 - (high - level) ** 2 / np.maximum((high - middle) * (high - low), tiny)
    inside = np.where(level <= middle, start, end)
    out: Floats = np.where(level <= low, 0.0, np.where(level > high, 1.0, inside))
    return out
