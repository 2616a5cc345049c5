"""The lateral film of one bubble between two plates: area, volume moments and their derivatives.

The bubble is the image of a box, X(λ, φ, t): t runs from the inner plate to the outer one, φ once round,
and λ from the bubble's axis to its film at λ = 1. X is known at nodes, in between it is a polynomial in λ
and t (Gauss–Lobatto nodes) and a trigonometric one in φ (an odd number of even nodes: with an even number the
film would not feel a zigzag). Then

- film area  A = ∫∫ |X_φ × X_t| dφ dt at λ = 1;
- moments    M_c = ∫∫∫ c(X) X_λ · (X_φ × X_t) dλ dφ dt; c = 1 gives the volume.

Node (k, j) of the film moves along one line only, its radius ρ_kj, and takes the nodes inside with it.
Gradients are exact derivatives of the discrete sums and need no more than dX/dρ. Hessians use the boundary's
second variation, which differs from that of the sums by quadrature error, and of d²X only the part along the
plates' normal: forces tangent to the plates vanish at equilibrium.

Arrays: (radial node,) height, angle, component.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from warpedfoam.arrays import Floats, Ints, frozen
from warpedfoam.kernels.quadrature import gauss, lobatto

#: Gauss points through the gap beyond the number of layers (which is the film's degree).
MORE_HEIGHTS = 2


@dataclass(frozen=True, eq=False)
class FilmGrid:
    """Nodes of a bubble and the matrices that differentiate and integrate between them.

    Attributes
    ----------
    heights : (L,) array
        Heights of the curves of nodes, from 0 to the gap.
    owner : (L,) int array
        Which of the free curves each of them follows: all the same one if the film is ruled.
    angles : (m,) array
        Even angles φ_j from 0.
    scales : (I,) array
        The radial nodes λ, from 0 to 1.
    rise, climb : (G, L) arrays
        From nodes to values and to t-derivatives at the G Gauss heights.
    turn : (m, m) array
        Derivative in φ of the trigonometric interpolant.
    outward : (I, I) array
        Derivative in λ.
    film_weights : (G, 1) array
        Weights of ∫∫ dφ dt.
    weights : (I, G, 1) array
        Weights of ∫∫∫ dλ dφ dt.
    """

    heights: Floats
    owner: Ints
    angles: Floats
    scales: Floats
    rise: Floats
    climb: Floats
    turn: Floats
    outward: Floats
    film_weights: Floats
    weights: Floats

    @property
    def n_free(self) -> int:
        """Number of curves that move on their own."""
        return int(self.owner[-1]) + 1


@lru_cache(maxsize=32)
def film_grid(gap: float, layers: int, n_angles: int, radial_order: int) -> FilmGrid:
    """Grid of a film of so many layers, between one curve of nodes more; a single layer is ruled.

    Examples
    --------
    >>> film_grid(1.0, 2, 5, 4).heights, film_grid(1.0, 2, 5, 4).owner, film_grid(1.0, 1, 5, 4).owner
    (array([0. , 0.5, 1. ]), array([0, 1, 2]), array([0, 0]))
    """
    rule, radial = lobatto(layers), lobatto(radial_order)
    at, shares = gauss(max(layers, 4) + MORE_HEIGHTS)
    rise = rule.interpolation(at)
    angles = 2.0 * np.pi * np.arange(n_angles) / n_angles
    film_weights = (gap * 2.0 * np.pi / n_angles) * shares[:, None]
    owner = np.zeros(2, dtype=np.int64) if layers == 1 else np.arange(layers + 1)
    return FilmGrid(
        frozen(gap * rule.nodes),
        frozen(owner),
        frozen(angles),
        radial.nodes,
        frozen(rise),
        frozen(rise @ rule.derivative / gap),
        frozen(_fourier_derivative(n_angles)),
        radial.derivative,
        frozen(film_weights),
        frozen(radial.weights[:, None, None] * film_weights),
    )


def _fourier_derivative(count: int) -> Floats:
    """(−1)^(i − j) / (2 sin((i − j) π/count)) off the diagonal, for an odd number of nodes."""
    apart = np.arange(count)[:, None] - np.arange(count)[None, :]
    with np.errstate(divide="ignore"):
        out = np.where(apart % 2 == 0, 0.5, -0.5) / np.sin(np.pi * apart / count)
    np.fill_diagonal(out, 0.0)
    return out


def resampled(radii: Floats, n_angles: int) -> Floats:
    """Radii (…, m) at another odd number of even angles, by their Fourier series."""
    modes = np.fft.rfft(radii, axis=-1) / radii.shape[-1]
    out: Floats = np.fft.irfft(modes, n_angles, axis=-1) * n_angles
    return out


def truncation(grid: FilmGrid, radii: Floats, points: Floats) -> float:
    """Highest modes of a bubble's radii (n, m) and of its nodes (I, L, m, 3) in λ, in mean radii.

    The last eighth of the Fourier modes, and the last two Legendre coefficients. It says how well angles and
    radial nodes resolve the bubble; energies err by about its square on smooth surfaces.
    """
    modes = np.abs(np.fft.rfft(radii, axis=-1)) / radii.shape[-1]
    last = modes[:, -max(1, modes.shape[1] // 8) :].max()
    fit = np.linalg.inv(np.polynomial.legendre.legvander(2.0 * grid.scales - 1.0, len(grid.scales) - 1))
    tail = np.abs(np.tensordot(fit[-2:], points, 1)).max()
    return float(max(2.0 * last, tail) / radii.mean())


def film_area(grid: FilmGrid, points: Floats) -> tuple[float, Floats]:
    """Film area and its derivative by the film's nodes, (L, m, 3) each."""
    around, up, normal, size = _slopes(grid, points)
    unit = grid.film_weights[..., None] * normal / size[..., None]
    force = _to_nodes(grid, np.cross(up, unit), np.cross(unit, around))
    return float((grid.film_weights * size).sum()), force


def _slopes(grid: FilmGrid, points: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """X_φ, X_t, their product and its length at the film's Gauss points (G, m)."""
    around = np.einsum("gk,ij,kjx->gix", grid.rise, grid.turn, points, optimize=True)
    up = np.tensordot(grid.climb, points, 1)
    normal = np.cross(around, up)
    return around, up, normal, np.linalg.norm(normal, axis=2)


def _to_nodes(grid: FilmGrid, by_around: Floats, by_up: Floats) -> Floats:
    """Chain from derivatives by X_φ and X_t to those by the nodes."""
    first = np.einsum("gk,ij,gix->kjx", grid.rise, grid.turn, by_around, optimize=True)
    out: Floats = first + np.tensordot(grid.climb.T, by_up, 1)
    return out


def region_points(grid: FilmGrid, points: Floats) -> Floats:
    """The Gauss points (I, G, m, 3) at which moments want their densities."""
    out: Floats = np.einsum("gk,ikjx->igjx", grid.rise, points)
    return out


def region_moments(
    grid: FilmGrid, points: Floats, densities: Floats, slopes: Floats
) -> tuple[Floats, Floats]:
    """Moments (C,) and their derivatives by the nodes, (C, I, L, m, 3).

    ``points`` (I, L, m, 3) are nodes; ``densities`` (C, I, G, m) and their gradients ``slopes``
    (C, I, G, m, 3) belong to `region_points`.
    """
    level = region_points(grid, points)
    out = np.tensordot(grid.outward, level, 1)
    around = np.matmul(grid.turn, level)
    up = np.einsum("gk,ikjx->igjx", grid.climb, points)
    by_out = np.cross(around, up)
    det = np.einsum("igjx,igjx->igj", out, by_out)
    weighted = grid.weights * densities
    moments = np.einsum("cigj,igj->c", weighted, det)
    scale = weighted[..., None]
    flat = np.einsum("ai,cagjx->cigjx", grid.outward, scale * by_out, optimize=True)
    flat += np.matmul(grid.turn.T, scale * np.cross(up, out))
    flat += (grid.weights * det)[..., None] * slopes
    nodal = np.einsum("gk,cigjx->cikjx", grid.rise, flat, optimize=True)
    nodal += np.einsum("gk,cigjx->cikjx", grid.climb, scale * np.cross(out, around), optimize=True)
    return moments, nodal


def film_hessian(
    grid: FilmGrid,
    points: Floats,
    moves: Floats,
    normals: Floats,
    bends: Floats,
    density: Floats,
    slope: Floats,
) -> Floats:
    """Second derivatives of A − ∫ c dV by the radii of all curves, (L m, L m).

    ``points``, ``moves`` = dX/dρ, ``normals`` (L, m, 3) and ``bends`` = n · d²X/dρ² (L, m) belong to the
    film's nodes; ``density`` c (G, m) and its gradient ``slope`` (G, m, 3) to its Gauss points.
    """
    n_heights, (n_layers, n_angles, _) = len(grid.rise), points.shape
    around, up, normal, size = _slopes(grid, points)
    unit = normal / size[..., None]
    weight = grid.film_weights * np.ones(n_angles)
    # changes at the Gauss points by each unknown: (G, m, 3, L, m)
    eye = np.eye(n_angles)
    by_around = np.einsum("gk,ij,kjx->gixkj", grid.rise, grid.turn, moves, optimize=True)
    by_up = np.einsum("gk,ij,kjx->gixkj", grid.climb, eye, moves, optimize=True)
    n_points, n = n_heights * n_angles, n_layers * n_angles
    flat = (n_points, 3, n)
    a, u = by_around.reshape(flat), by_up.reshape(flat)
    change = _cross(a, up.reshape(-1, 3)) - _cross(u, around.reshape(-1, 3))
    e = unit.reshape(-1, 3)
    across = change - e[:, :, None] * np.einsum("px,pxn->pn", e, change)[:, None]
    rows = (np.sqrt(weight / size).reshape(-1, 1, 1) * across).reshape(-1, n)
    hessian: Floats = rows.T @ rows
    # unit · (δX_φ × δ'X_t) of the area, c δX · (δ'X_φ × X_t + X_φ × δ'X_t) of the moment
    w, c = weight.reshape(-1, 1, 1), density.reshape(-1, 1, 1)
    half = a.reshape(-1, n).T @ (w * _cross(u, e)).reshape(-1, n)
    here = np.einsum("gk,ij,kjx->gixkj", grid.rise, eye, moves, optimize=True).reshape(flat)
    half -= 0.5 * here.reshape(-1, n).T @ (w * c * change).reshape(-1, n)
    lever = np.einsum("px,pxn->pn", normal.reshape(-1, 3), here)
    half -= 0.5 * lever.T @ (w[:, :, 0] * np.einsum("px,pxn->pn", slope.reshape(-1, 3), here))
    hessian += half + half.T
    _, force = film_area(grid, points)
    push = (weight * density)[..., None] * normal
    force -= np.tensordot(grid.rise.T, push, 1)
    np.einsum("nn->n", hessian)[:] += (np.einsum("kjx,kjx->kj", force, normals) * bends).ravel()
    return hessian


def _cross(columns: Floats, vectors: Floats) -> Floats:
    """Columns (p, 3, n) × vectors (p, 3)."""
    x, y, z = columns[:, 0], columns[:, 1], columns[:, 2]
    a, b, c = vectors.T[:, :, None]
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=1)
