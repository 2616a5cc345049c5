"""Normals, shape operators and curvatures of a level set f = 0 from the derivatives of f."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats


def normal_shape(gradient: Floats, second: Floats) -> tuple[Floats, Floats]:
    """n = ∇f/|∇f| and W = (I − nnᵀ) ∇²f (I − nnᵀ)/|∇f|."""
    size = np.linalg.norm(gradient, axis=1)
    normal = gradient / size[:, None]
    bent = np.einsum("nxy,ny->nx", second, normal)
    shape = second - normal[:, :, None] * bent[:, None] - bent[:, :, None] * normal[:, None]
    shape += np.einsum("nx,nx->n", normal, bent)[:, None, None] * (normal[:, :, None] * normal[:, None])
    return normal, shape / size[:, None, None]


def bent_mean_gauss(normal: Floats, bend: Floats) -> tuple[Floats, Floats]:
    """H and G from n and B = ∇²f/|∇f|: tr W = tr B − nᵀBn, tr W² = tr B² − 2 |Bn|² + (nᵀBn)²."""
    bent = np.einsum("nxy,ny->nx", bend, normal)
    across = np.einsum("nx,nx->n", normal, bent)
    trace = np.einsum("nxx->n", bend) - across
    square = np.einsum("nxy,nxy->n", bend, bend) - 2.0 * np.einsum("nx,nx->n", bent, bent) + across**2
    return 0.5 * trace, 0.5 * (trace**2 - square)


def mean_gauss(shape: Floats) -> tuple[Floats, Floats]:
    """H and G of shape operators (…, 3, 3) whose third eigenvalue, along the normal, is 0."""
    trace = np.einsum("...xx->...", shape)
    square = np.einsum("...xy,...xy->...", shape, shape)
    return 0.5 * trace, 0.5 * (trace**2 - square)
