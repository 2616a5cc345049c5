"""`anneal_points`: repelling points cooled slowly, as nearly perfect crystals to start foams from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from warpedfoam.arrays import Floats, as_generator, as_instance, as_integer, as_number, as_points, frozen
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.studies.thomson import ThomsonPoints, energy_and_force
from warpedfoam.surfaces.places import Places
from warpedfoam.surfaces.protocol import Surface

#: Reach of the repulsion and how far beyond it neighbours are listed, in spacings.
REACH, MARGIN = 2.7, 0.8
#: Time step, friction, largest step; units: the spacing, a point's mass, the energy of two a spacing apart.
STEP, FRICTION, FARTHEST = 0.05, 0.5, 0.2
#: Distances are taken to be at least this: random starts have points on top of each other.
CLOSEST = 0.4
#: Last share of the steps, without heat.
COLD = 0.05


def anneal_points(
    surface: Surface,
    n: int,
    *,
    seed: int | np.random.Generator = 0,
    steps: int = 4000,
    temperature: float = 0.25,
    cooling: float = 0.05,
    exponent: float = 3.0,
    start: ArrayLike | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> ThomsonPoints:
    """Let repelling points jiggle on a surface while they cool: fewer dislocations than at once to rest.

    Langevin dynamics of points of unit mass with the energy Σ (ℓ/r)^s over pairs closer than 2.7 ℓ,
    ℓ = sqrt(area/n), at the temperature T_k = temperature · cooling^(k/steps); the last twentieth of the
    steps has no heat. A crystal with s = 3 melts at about T = 0.5; below that dislocations glide and climb.
    Distances are straight; every step ends on the surface.

    Parameters
    ----------
    surface : Surface
        Without rims.
    n : int
        Number of points, at least 2.
    seed : int or numpy.random.Generator, optional
        Of the random start and the jiggling.
    steps : int, optional
        Each costs about as much as a sum over 12 n pairs.
    temperature : float, optional
        First one, in units of the energy of two points a spacing ℓ apart.
    cooling : float, optional
        Last temperature over the first, above 0 and up to 1.
    exponent : float, optional
        s, from 0.5 to 12.
    start : (n, 3) array, optional
        Points to begin with instead of random ones; projected.
    progress : callable, optional
        Called as ``progress("points", fraction)`` a hundred times.

    Returns
    -------
    ThomsonPoints
        With the Riesz energy over all pairs; nearly at rest, not at a minimum of it (look at ``force``).

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, or the surface has rims.

    See Also
    --------
    thomson_points : straight to the next minimum.

    References
    ----------
    K. Zahn, R. Lenke and G. Maret, Phys. Rev. Lett. 82, 2721 (1999), for the melting of r⁻³ crystals
    in the plane.

    Examples
    --------
    >>> from warpedfoam import Sphere
    >>> found = anneal_points(Sphere(1.0), 40, seed=1, steps=300)
    >>> found.points.shape, found.seed
    ((40, 3), 1)
    """
    as_instance(surface, "surface", Surface)  # type: ignore[type-abstract]
    if surface.rim is not None:
        raise ValueError("surface must have no rims: points that repel each other pile up on them")
    count = as_integer(n, "n", minimum=2, maximum=200_000)
    rng = as_generator(seed)
    total = as_integer(steps, "steps", minimum=0, maximum=100_000_000)
    hot = as_number(temperature, "temperature", minimum=0.0, maximum=1e3)
    ratio = as_number(cooling, "cooling", positive=True, maximum=1.0)
    s = as_number(exponent, "exponent", minimum=0.5, maximum=12.0)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    if start is None:
        points = surface.random_points(count, rng)
    else:
        points = surface.project(as_points(start, "start"))
        if len(points) != count:
            raise ValueError(f"start must hold n = {count} points, got {len(points)}")
    spacing = float(np.sqrt(surface.area / count))
    crystal = _Crystal(surface, spacing, s, points)
    velocity = np.zeros_like(points)
    kept = np.exp(-FRICTION * STEP)
    for k in range(total):
        heat = hot * ratio ** (k / total) if k < (1.0 - COLD) * total else 0.0
        velocity = velocity + 0.5 * STEP * crystal.force
        noise = rng.standard_normal(points.shape)
        velocity = kept * velocity + np.sqrt((1.0 - kept**2) * heat) * noise
        velocity = crystal.move(velocity) + 0.5 * STEP * crystal.force
        if progress is not None and (k + 1) % max(total // 100, 1) == 0:
            progress("points", (k + 1) / total)
    energy, force = energy_and_force(surface, crystal.points, s, spacing)
    fixed = None if isinstance(seed, np.random.Generator) else int(seed)
    return ThomsonPoints(frozen(crystal.points), energy, s, force, total, fixed)


class _Crystal:
    """Points, the forces on them, and the list of pairs that are near.

    Lengths are in spacings, but for ``points``.
    """

    def __init__(self, surface: Surface, spacing: float, exponent: float, points: Floats) -> None:
        self._surface, self._spacing, self._exponent = surface, spacing, exponent
        self.points = points
        self._list()
        self.force = self._force()

    def move(self, velocity: Floats) -> Floats:
        """A time step; the velocities that are tangential there."""
        surface = self._surface
        normal = surface.normals(self.points)
        velocity = velocity - np.einsum("ij,ij->i", velocity, normal)[:, None] * normal
        # random starts push hard
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        velocity = velocity * np.minimum(1.0, FARTHEST / STEP / np.maximum(speed, 1e-300))
        self.points = surface.project(self.points + self._spacing * STEP * velocity)
        gone = nearest_image(self.points - self._listed, surface.period) / self._spacing
        if float(np.einsum("ij,ij->i", gone, gone).max()) > (0.5 * MARGIN) ** 2:
            self._list()
        self.force = self._force()
        return velocity

    def _list(self) -> None:
        """Pairs within reach and margin, and the matrix that adds what they feel."""
        self._listed, n = self.points, len(self.points)
        reach = (REACH + MARGIN) * self._spacing
        period = self._surface.period
        if period is not None:
            # a tree knows one image of each point, so it reaches no farther than half a period
            reach = min(reach, 0.499 * float(period[np.isfinite(period)].min()))
        self._pairs = Places(self.points, period).pairs(reach)
        m = len(self._pairs)
        each = np.arange(m)
        signs = np.concatenate([np.ones(m), -np.ones(m)])
        places = (self._pairs.T.ravel(), np.concatenate([each, each]))
        self._sum = csr_array((signs, places), shape=(n, m))

    def _force(self) -> Floats:
        first, second = self._pairs.T
        apart = nearest_image(self.points[first] - self.points[second], self._surface.period)
        square = np.einsum("ij,ij->i", apart, apart) / self._spacing**2
        inverse = (square < REACH**2) / np.maximum(square, CLOSEST**2)
        size = self._exponent * inverse ** (0.5 * self._exponent + 1.0) / self._spacing
        out: Floats = self._sum @ (size[:, None] * apart)
        normal = self._surface.normals(self.points)
        out -= np.einsum("ij,ij->i", out, normal)[:, None] * normal
        return out
