"""Seeds of a Voronoi foam: random, blue noise, lattice, or the user's own."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Bools, Floats, Ints, as_generator, as_integer, as_points
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.thinning import accepted
from warpedfoam.surfaces.places import Places
from warpedfoam.surfaces.protocol import Surface

_DARTS = 8  # candidates per blue-noise seed
_WIDEST = 0.85  # of √(area/n): disks jammed at random are this wide


def random_seeds(surface: Surface, n: int, rng: object) -> Floats:
    """Points drawn independently and uniformly by area, (n, 3).

    Parameters
    ----------
    surface : Surface
    n : int
        At least 1.
    rng : int or numpy.random.Generator

    Raises
    ------
    TypeError, ValueError
        If ``n`` or ``rng`` is not what it should be.
    """
    return surface.random_points(as_integer(n, "n", minimum=1), as_generator(rng, "rng"))


def lattice_seeds(surface: Surface, n: int) -> Floats:
    """The surface's even, deterministic arrangement, (n, 3).

    Raises
    ------
    TypeError, ValueError
        If ``n`` is not an integer of at least 1.
    """
    return surface.lattice_points(as_integer(n, "n", minimum=1))


def blue_noise_seeds(surface: Surface, n: int, rng: object) -> Floats:
    """Random points no two of which are close: dart throwing with the widest disks that fit n, (n, 3).

    Darts drawn uniformly by area are accepted in order, each unless an earlier accepted one lies
    within R (a straight distance); R is bisected to the largest that leaves at least n, and the
    last few are dropped. The acceptance is done in rounds over all darts at once and gives
    exactly what one dart after another would.

    Parameters
    ----------
    surface : Surface
    n : int
        At least 1.
    rng : int or numpy.random.Generator

    Returns
    -------
    (n, 3) array
        No two closer than about 0.7 √(area/n).

    Raises
    ------
    TypeError, ValueError
        If ``n`` or ``rng`` is not what it should be.

    Examples
    --------
    >>> from scipy.spatial.distance import pdist
    >>> from warpedfoam.surfaces import Sphere
    >>> seeds = blue_noise_seeds(Sphere(radius=1.0), 100, rng=0)
    >>> bool(pdist(seeds).min() > 0.2)
    True
    """
    count, generator = as_integer(n, "n", minimum=1), as_generator(rng, "rng")
    darts: Floats = surface.random_points(_DARTS * count, generator)
    spacing = float(np.sqrt(surface.area / count))
    pairs, lengths = _close_pairs(darts, _WIDEST * spacing, surface.period)

    def thinned(radius: float) -> Bools:
        return accepted(len(darts), pairs[:, lengths < radius])

    low, high = 0.72 * spacing, _WIDEST * spacing
    while np.count_nonzero(chosen := thinned(low)) < count:
        low, high = 0.9 * low, low
    for _ in range(6):
        middle = 0.5 * (low + high)
        if np.count_nonzero(kept := thinned(middle)) >= count:
            low, chosen = middle, kept
        else:
            high = middle
    return np.compress(chosen, darts, axis=0)[:count]


def check_seeds(surface: Surface, points: ArrayLike) -> Floats:
    """Return the user's seeds, projected exactly onto the surface.

    Parameters
    ----------
    surface : Surface
    points : (n, 3) array
        On the surface within 1e-6 of its size, no two within 1e-9 of its size.

    Raises
    ------
    TypeError, ValueError
        If they are not finite (n, 3) numbers, off the surface, or coincide.
    """
    given = as_points(points, "seeds")
    seeds = surface.project(given)
    off = np.linalg.norm(seeds - given, axis=1)
    worst = int(off.argmax())
    if off[worst] > 1e-6 * surface.size:
        raise ValueError(
            f"seeds must lie on the surface, but seed {worst} is {off[worst]:.3g} off it; "
            "project them with surface.project(seeds)"
        )
    same = Places(seeds, surface.period).pairs(1e-9 * surface.size)
    if len(same):
        first, second = sorted(int(i) for i in same[np.lexsort(same.T[::-1])[0]])
        raise ValueError(f"seeds must be distinct, but seeds {first} and {second} coincide; remove one")
    return seeds


def _close_pairs(points: Floats, radius: float, period: Floats | None) -> tuple[Ints, Floats]:
    """Pairs i < j nearer than the radius, (2, m), and their distances."""
    pairs = Places(points, period).pairs(radius).T
    return pairs, np.linalg.norm(nearest_image(points[pairs[0]] - points[pairs[1]], period), axis=1)
