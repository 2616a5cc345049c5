"""Gas that passes through films from bubble to bubble."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats, as_instance, as_number, frozen
from warpedfoam.foam import Foam


def gas_flow(foam: Foam, *, permeability: float = 1.0) -> Floats:
    """Rate at which each bubble gains volume by gas that passes through its films.

    dV_i/dt = −κ Σ (p_i − p_j) A_ij over the films of bubble i, A_ij their areas. In a relaxed foam between
    plates a uniform thin gap apart that is von Neumann's law on a curved surface,
    dA_i/dt = κγ [(π/3)(n_i − 6) + ∫_i G dA]. Walls let nothing through.

    Parameters
    ----------
    foam : Foam
        Relaxed, with its pressures.
    permeability : float, optional
        κ, volume per time, film area and pressure.

    Returns
    -------
    (n_bubbles,) array
        They add up to 0. Energy is lost at the rate κ Σ (p_i − p_j)² A_ij.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, or the foam has no pressures.

    References
    ----------
    J. von Neumann, in Metal Interfaces (1952), 108-110; J. E. Avron and D. Levine, Phys. Rev. Lett. 69, 208
    (1992); A. E. Roth, C. D. Jones and D. J. Durian, Phys. Rev. E 86, 021402 (2012).

    Examples
    --------
    On the unit sphere bubbles of n sides and area (6 − n) π/3 neither grow nor shrink:

    >>> import numpy as np
    >>> from warpedfoam import Foam, HeleShawCell, Sphere, relax
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> four = relax(Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)).foam
    >>> bool(np.abs(gas_flow(four)).max() < 1e-10)
    True
    """
    as_instance(foam, "foam", Foam)
    kappa = as_number(permeability, "permeability", positive=True)
    if foam.pressures is None:
        raise ValueError("foam has no pressures: relax it first")
    network = foam.network
    flow = kappa * (foam.pressures[network.left] - foam.pressures[network.right]) * foam.film_areas
    n = foam.n_bubbles
    return frozen(np.bincount(network.right, flow, n) - np.bincount(network.left, flow, n))


def gas_dissipation(foam: Foam, *, permeability: float = 1.0) -> float:
    """Energy that a relaxed foam loses per time by the flow of gas, κ Σ (p_i − p_j)² A_ij.

    Parameters
    ----------
    foam : Foam
        Relaxed, with its pressures.
    permeability : float, optional
        κ; see `gas_flow`.

    Raises
    ------
    TypeError, ValueError
        As in `gas_flow`.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, relax, voronoi_foam
    >>> foam = relax(voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), 40, seed=1)).foam
    >>> gas_dissipation(foam, permeability=2.0) > gas_dissipation(foam) > 0.0
    True
    """
    flow = gas_flow(foam, permeability=permeability)
    assert foam.pressures is not None
    return -float(flow @ foam.pressures)
