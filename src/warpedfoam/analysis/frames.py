"""Tangent frames on the surface, moved from place to place by parallel transport."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Floats, Ints
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image


def transported(vectors: Floats, start: Floats, end: Floats) -> Floats:
    """Tangent vectors (…, 3) turned by the least rotation that takes unit normal ``start`` to ``end``.

    v′ = v − (v · m)(n + m) / (1 + n · m). Along a great circle this is parallel transport; elsewhere it
    is so up to the third order in the distance.

    Examples
    --------
    >>> transported(np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    array([-1.,  0.,  0.])
    """
    cosine = np.einsum("...x,...x->...", start, end)
    share = np.einsum("...x,...x->...", vectors, end) / np.maximum(1.0 + cosine, 1e-12)
    out: Floats = vectors - share[..., None] * (start + end)
    return out


def as_complex(vectors: Floats, frames: Floats) -> NDArray[np.complex128]:
    """Components of tangent vectors (n, 3) in frames (n, 2, 3) as x + iy."""
    parts = np.einsum("nx,nkx->nk", vectors, frames)
    out: NDArray[np.complex128] = parts[:, 0] + 1j * parts[:, 1]
    return out


def oriented_frames(foam: Foam, points: Floats) -> tuple[Floats, Floats]:
    """Normals (n, 3), and frames (n, 2, 3) whose second vector lies 90° counter-clockwise of the first."""
    surface = foam.cell.surface
    normals = surface.normals(points)
    first = surface.vertex_frames(points)[:, 0]
    first = first - np.einsum("nx,nx->n", first, normals)[:, None] * normals
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return normals, np.stack([first, np.cross(normals, first)], axis=1)


def links(normals: Floats, frames: Floats, tail: Ints, head: Ints) -> Floats:
    """Angles A (k,) by which components turn from frame ``tail`` to frame ``head``.

    A vector with components z at the tail has z e^{iA} at the head after parallel transport.
    """
    moved = transported(frames[tail, 0], normals[tail], normals[head])
    out: Floats = np.angle(as_complex(moved, frames[head]))
    return out


def unwrapped(foam: Foam, labels: Ints) -> Floats:
    """Bubble centres (n, 3) in images that lie side by side within each region of ``labels`` (n,).

    The surfaces that do not repeat have one image only. A region that winds round the surface is cut
    somewhere.
    """
    centres, period = foam.bubble_centres, foam.cell.surface.period
    if period is None:
        return centres
    network = foam.network
    one, two = network.left, network.right
    within = (labels[one] == labels[two]) & (labels[one] >= 0)
    tail = np.concatenate([one[within], two[within]])
    head = np.concatenate([two[within], one[within]])
    step = nearest_image(centres[head] - centres[tail], period)
    out = centres.copy()
    known = labels < 0
    _, roots = np.unique(labels, return_index=True)
    known[roots] = True
    while True:
        new = known[tail] & ~known[head]
        if not new.any():
            return out
        out[head[new]] = out[tail[new]] + step[new]
        known[head[new]] = True
