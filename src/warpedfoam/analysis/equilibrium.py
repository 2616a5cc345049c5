"""How well a foam meets Plateau's and Laplace's laws and the Gauss–Bonnet pressure identity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, as_instance, frozen
from warpedfoam.foam import Foam
from warpedfoam.kernels.quadrature import lobatto


@dataclass(frozen=True, eq=False)
class EquilibriumReport:
    """Angles, curvatures and pressures of a foam, and how far each is from equilibrium.

    Attributes
    ----------
    vertex_angles : (n_threefold, 3) array
        Angles between neighbouring films in the tangent plane, radians.
    angle_error : float
        Largest |angle − 2π/3|.
    wall_angles : (n_rim_vertices,) array
        Angles between films and the walls on which they end, in the order of ``network.rim_vertices``.
    wall_error : float
        Largest |wall angle − π/2|; 0 without rims.
    geodesic_curvatures : (n_films,) array
        Length-weighted mean κ_g of each film, positive where its left bubble is convex.
    film_curvatures : (n_films,) array
        Length-weighted mean of κ_g + ∂_ν ln d, ν pointing out of the left bubble: κ_g where the gap does not
        vary, and what pressures balance where it does.
    curvature_spread : (n_films,) array
        Largest deviation of κ_g + ∂_ν ln d along the film from its mean.
    laplace_error : float or None
        Largest |κ_g + ∂_ν ln d − (p_left − p_right)/γ| of the means; None if the foam has no pressures.
    pressure_identity : (n_bubbles,) array or None
        Σ_j (p_i − p_j) ℓ_ij / γ − [(π/3) q_i − ∫_i G dA − ∫ κ_g ds along its walls + ∫ ∂_ν ln d ds along its
        films] of each bubble, ν pointing out of it.
    identity_error : float or None
        Largest |pressure_identity|.
    """

    vertex_angles: Floats
    angle_error: float
    wall_angles: Floats
    wall_error: float
    geodesic_curvatures: Floats
    film_curvatures: Floats
    curvature_spread: Floats
    laplace_error: float | None
    pressure_identity: Floats | None
    identity_error: float | None


def equilibrium_report(foam: Foam) -> EquilibriumReport:
    """Measure vertex angles, geodesic curvatures, Laplace's law and the pressure identity.

    At equilibrium films meet at 120° and walls at 90°, κ_g is constant along a film and equals
    (p_i − p_j)/γ, and by Gauss–Bonnet Σ_j (p_i − p_j) ℓ_ij/γ = (π/3) q_i − ∫_i G dA − ∫ κ_g ds along its
    walls for every bubble, with the charge q_i = 6 − films − 2 walls. Where the gap varies, κ_g + ∂_ν ln d
    takes the place of κ_g in Laplace's law, and the identity gains ∫ ∂_ν ln d ds. These hold
    as the gap goes to 0 (and the angles at any gap on a sphere); at a gap d the ruled film makes
    them off by the order of d times the curvature.

    Parameters
    ----------
    foam : Foam
        With ``pressures`` for the last two, as `warpedfoam.relax` returns it.

    Returns
    -------
    EquilibriumReport
        Angles and curvatures come from differentiating the films' points and lose digits to the
        film order: take p = 8 for checks.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, relax, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=1e-6), n_bubbles=32, seeds="lattice")
    >>> report = equilibrium_report(relax(foam, order=8).foam)
    >>> report.identity_error < 1e-5, report.angle_error < 1e-5
    (True, True)
    """
    as_instance(foam, "foam", Foam)
    surface, network = foam.cell.surface, foam.network
    rule = lobatto(foam.order + 8)
    curve = foam.film_curves_at(rule.nodes)
    first = np.einsum("kj,fjx->fkx", rule.derivative, curve)
    second = np.einsum("kj,fjx->fkx", rule.derivative, first)
    normal = surface.normals(curve.reshape(-1, 3)).reshape(curve.shape)
    speed = np.linalg.norm(first, axis=2)
    kappa = np.einsum("fkx,fkx->fk", normal, np.cross(first, second)) / speed**3
    weight = rule.weights * speed
    length = weight.sum(axis=1)
    mean = (weight * kappa).sum(axis=1) / length
    # ν |x'| = x' × n points to the right, out of the bubble on the left
    slope = np.einsum("fkx,fkx->fk", foam.cell.log_gap_slopes(curve), np.cross(first, normal)) / speed
    balanced = kappa + slope
    pull_of = (weight * balanced).sum(axis=1) / length
    spread = np.abs(balanced - pull_of[:, None]).max(axis=1)

    tangent = np.empty((2 * network.n_films, 3))
    tangent[0::2] = first[:, 0] / speed[:, 0, None]
    tangent[1::2] = -first[:, -1] / speed[:, -1, None]
    out = network.outgoing
    here = surface.normals(foam.vertex_points[network.origin[out[:, 0]]]) if len(out) else np.zeros((0, 3))
    a, b = tangent[out], tangent[np.roll(out, -1, axis=1)]
    sine = np.einsum("vx,vkx->vk", here, np.cross(a, b))
    angles = np.mod(np.arctan2(sine, np.einsum("vkx,vkx->vk", a, b)), 2.0 * np.pi)

    walls = np.zeros(0)
    if surface.rim is not None:
        leaving = np.argsort(network.origin, kind="stable")
        leaving = leaving[np.searchsorted(network.origin[leaving], network.rim_vertices)]
        along = surface.rim.frame(*surface.rim.locate(foam.vertex_points[network.rim_vertices]))[0]
        cosine = np.einsum("vx,vx->v", tangent[leaving], along)
        walls = np.arccos(np.clip(cosine, -1.0, 1.0))

    laplace, identity, worst = None, None, None
    if foam.pressures is not None:
        drop = (foam.pressures[network.left] - foam.pressures[network.right]) / foam.tension
        laplace = float(np.abs(pull_of - drop).max())
        pull = drop * foam.film_lengths - (weight * slope).sum(axis=1)
        count = network.n_bubbles
        total = np.bincount(network.left, pull, minlength=count)
        total -= np.bincount(network.right, pull, minlength=count)
        bend = foam.bubble_curvatures + foam.wall_turning
        identity = frozen(total - (np.pi / 3.0 * network.charges - bend))
        worst = float(np.abs(identity).max())
    return EquilibriumReport(
        frozen(angles),
        float(np.abs(angles - 2.0 * np.pi / 3.0).max(initial=0.0)),
        frozen(walls),
        float(np.abs(walls - 0.5 * np.pi).max(initial=0.0)),
        frozen(mean),
        frozen(pull_of),
        frozen(spread),
        laplace,
        identity,
        worst,
    )
