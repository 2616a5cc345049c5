"""Correlations against geodesic distance: orientation g6(s), charges, and how far charges are screened."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from warpedfoam.analysis.defects import lattice_spacing
from warpedfoam.analysis.order import bond_order
from warpedfoam.analysis.paths import BubblePaths
from warpedfoam.arrays import Floats, Ints, as_generator, as_integer, as_number, frozen
from warpedfoam.errors import ResolutionError
from warpedfoam.foam import Foam

#: Sources whose paths are held in memory at once, times bubbles.
_AT_ONCE = 4_000_000


@dataclass(frozen=True, eq=False)
class Correlations:
    """Correlations of one foam, or their means over an ensemble, in bins of distance; arrays (k,).

    Attributes
    ----------
    distance : (k,) array
        Middles of the bins.
    edges : (k + 1,) array
        Their edges.
    pairs : (k,) integer array
        Ordered pairs of bubbles in each bin, over all foams; the other columns are 0 where there are none.
    g6 : (k,) array
        ⟨Re ψ6_i* P ψ6_j⟩ / ⟨|ψ6|²⟩, P the parallel transport from j to i.
    charge : (k,) array
        ⟨δ_i δ_j⟩ / ⟨δ²⟩, δ the charge less (3/π)∫G dA of its bubble.
    screening : (k + 1,) array
        S at the edges: charge within that distance round a bubble, per charge δ of the bubble itself,
        1 at distance 0 and 0 once it is screened.
    screening_length : float or None
        Where S first falls to 1/e; None if it does not within the range.
    spacing : float
        The lattice spacing a, mean over the foams.
    n_foams : int
    """

    distance: Floats
    edges: Floats
    pairs: Ints
    g6: Floats
    charge: Floats
    screening: Floats
    screening_length: float | None
    spacing: float
    n_foams: int


def excess_charges(foam: Foam) -> Floats:
    """δ_i = q_i − (3/π)∫_i G dA, the charge beyond what curvature asks for; it adds up to 0.

    On closed surfaces Σ q = 6 χ = (3/π) ∫ G dA. By Gauss–Bonnet δ_i is 3/π times the sum of pressure
    jumps times film lengths, in equilibrium at a thin gap. Exteriors have none.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=50, seed=1)
    >>> abs(float(excess_charges(foam).sum())) < 1e-9
    True
    """
    out: Floats = foam.network.charges - (3.0 / np.pi) * foam.bubble_curvatures
    return np.where(foam.network.bubble_euler == 1, out, 0.0)


def correlations(
    foams: Foam | Iterable[Foam],
    *,
    bin_width: float = 0.5,
    max_distance: float | None = None,
    n_sources: int | None = None,
    seed: int = 0,
) -> Correlations:
    """Orientation and charge correlations against distance, of a foam or an ensemble.

    Distances and transport follow shortest paths over neighbours and their neighbours: exact steps on a
    sphere, paths at most 3.5 % too long where the foam is a honeycomb (`BubblePaths`).

    The screening function S(s) = ⟨δ_i Σ_{d(i,j) ≤ s} δ_j⟩ / ⟨δ²⟩ starts at 1, and reaches 0 when all bubbles
    are counted, because the δ of a closed surface add up to 0. The screening length is where it first
    falls to 1/e.

    Parameters
    ----------
    foams : Foam or iterable of Foam
        Foams of an ensemble share the bins, in lengths of the first one's lattice spacing.
    bin_width, max_distance : float, optional
        In lattice spacings. By default as far as the farthest pair of the first foam.
    n_sources : int, optional
        Bubbles to start from, drawn without replacement in each foam; all by default.
    seed : int, optional
        Of that draw.

    Returns
    -------
    Correlations

    Raises
    ------
    TypeError, ValueError
        No foam, or numbers out of range.
    ResolutionError
        If no foam has two bubbles that are disks.

    Notes
    -----
    O(m n log n) time for m sources and n bubbles: all of 1000 bubbles take about a second.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=60, seed=1)
    >>> found = correlations(foam, bin_width=1.0)
    >>> int(found.pairs.sum()), abs(round(float(found.screening[-1]), 9))
    (3540, 0.0)
    """
    members = as_foams(foams)
    width = as_number(bin_width, "bin_width", positive=True)
    farthest = None if max_distance is None else as_number(max_distance, "max_distance", positive=True)
    some = None if n_sources is None else as_integer(n_sources, "n_sources", minimum=1)
    rng = as_generator(seed)
    unit = lattice_spacing(members[0])
    limit = np.inf if farthest is None else farthest * unit * (1.0 + 1e-9)
    pairs_of = [_pairs(foam, some, rng, limit) for foam in members]
    if farthest is None:
        farthest = max(float(d[0].max(initial=0.0)) for d in pairs_of) / unit * (1.0 + 1e-12)
    if not farthest > 0.0:
        raise ResolutionError("correlations need a foam of at least two bubbles")
    count = max(1, int(np.ceil(farthest / width - 1e-9)))
    edges: Floats = (unit * width) * np.arange(count + 1, dtype=np.float64)
    n_pairs = np.zeros(count, dtype=np.int64)
    order, charge = np.zeros(count), np.zeros(count)
    order_norm = charge_norm = 0.0
    n_sources_used = 0
    for distance, order_product, charge_product, order_square, charge_square, used in pairs_of:
        place = np.searchsorted(edges, distance, side="left") - 1
        within = place < count
        place = np.maximum(place[within], 0)
        n_pairs += np.bincount(place, minlength=count)
        order += np.bincount(place, order_product[within], count)
        charge += np.bincount(place, charge_product[within], count)
        order_norm += order_square
        charge_norm += charge_square
        n_sources_used += used
    # a bubble without any order or charge leaves nothing to divide by, and nothing to divide
    order_mean, charge_mean = (max(v / n_sources_used, 1e-300) for v in (order_norm, charge_norm))
    safe = np.maximum(n_pairs, 1)
    screening = np.ones(count + 1)
    screening[1:] += np.cumsum(charge) / max(charge_norm, 1e-300)
    return Correlations(
        frozen(0.5 * (edges[1:] + edges[:-1])),
        frozen(edges),
        frozen(n_pairs),
        frozen(order / safe / order_mean),
        frozen(charge / safe / charge_mean),
        frozen(screening),
        _falls_to(screening, edges, 1.0 / np.e),
        float(np.mean([lattice_spacing(foam) for foam in members])),
        len(members),
    )


def as_foams(foams: object) -> list[Foam]:
    """Return a list of at least one foam from a foam or an iterable of them."""
    members = [foams] if isinstance(foams, Foam) else list(foams) if isinstance(foams, Iterable) else []
    if not members or not all(isinstance(foam, Foam) for foam in members):
        raise TypeError(f"foams must be a Foam or hold at least one Foam, got {type(foams).__name__}")
    return members


def _pairs(
    foam: Foam, some: int | None, rng: np.random.Generator, limit: float
) -> tuple[Floats, Floats, Floats, float, float, int]:
    """Distances, ψ6 and δ products of all ordered pairs (source, other), and Σ|ψ6|², Σδ² of the sources."""
    order = bond_order(foam)
    delta = excess_charges(foam)
    paths = BubblePaths(foam, order.normals, order.frames)
    inside = np.flatnonzero(foam.network.bubble_euler == 1)
    sources = inside if some is None or some >= len(inside) else np.sort(rng.choice(inside, some, False))
    found: list[tuple[Floats, Floats, Floats]] = []
    for chunk in np.array_split(sources, max(1, len(sources) * foam.n_bubbles // _AT_ONCE)):
        distance, angle = paths.distances(chunk, limit)
        use = np.isfinite(distance)
        use[np.arange(len(chunk)), chunk] = False
        source, other = np.nonzero(use)
        source_bubble = chunk[source]
        moved = order.psi6[source_bubble] * np.exp(6j * angle[source, other])
        product = (moved.conj() * order.psi6[other]).real
        found.append((distance[source, other], product, delta[source_bubble] * delta[other]))
    joined = [np.concatenate(parts) for parts in zip(*found, strict=True)]
    squares = (float((order.magnitude[sources] ** 2).sum()), float((delta[sources] ** 2).sum()))
    return joined[0], joined[1], joined[2], *squares, len(sources)


def _falls_to(values: Floats, where: Floats, level: float) -> float | None:
    """Where ``values`` first falls to ``level``, between its points by a line."""
    below = np.flatnonzero(values <= level)
    if not below.size:
        return None
    k = int(below[0])
    share = (values[k - 1] - level) / (values[k - 1] - values[k])
    return float(where[k - 1] + share * (where[k] - where[k - 1]))
