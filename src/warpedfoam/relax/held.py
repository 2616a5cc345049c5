"""Vertices that move along a line only: markers across their film, rim vertices along the rim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.t1 import outward_tangents
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.protocol import Surface

#: Weights with which markers that follow are spaced: of the stretch of their links, and of their way.
LINK, GRIP = 1e-2, 1e-5


@dataclass(frozen=True, eq=False)
class Held:
    """Vertices (k,) and the unit directions (k, 2), in their frames, in which no force moves them.

    ``share`` (k,) is one film's share of the stiffness that holds a vertex; ``turning`` (k,) how fast the
    line on which it moves turns towards the direction, κ_g of a rim. ``linked`` (m,) are films that end in
    a marker and ``links`` (4, m) the stretch of their chords by steps of their ends (`relax/following.py`).
    """

    vertices: Ints
    directions: Floats
    share: Floats
    turning: Floats
    linked: Ints
    links: Floats


def held_vertices(surface: Surface, network: CellNetwork, points: Floats, offsets: Floats) -> Held | None:
    """What is held at a state, or None.

    A marker that slid along its film would exploit the quadrature; a rim vertex leaves the surface.
    """
    parts = []
    linked, links = np.zeros(0, dtype=np.int64), np.zeros((4, 0))
    if len(network.markers):
        along = marker_tangents(surface, network, points, offsets)
        count = len(along)
        parts.append((network.markers, along, np.full(count, 0.5), np.zeros(count)))
        linked, links = _links(surface, network, points)
    if surface.rim is not None and len(network.rim_vertices):
        at = points[network.rim_vertices]
        places = surface.rim.locate(at)
        inward = surface.rim.frame(*places)[1]
        flat = np.einsum("mij,mj->mi", surface.vertex_frames(at), inward)
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        parts.append((network.rim_vertices, flat, np.ones(len(at)), surface.rim.curvatures(*places)))
    if not parts:
        return None
    vertices, directions, share, turning = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Held(vertices, directions, share, turning, linked, links)


def without_markers(held: Held, count: int) -> Held | None:
    """What is held but for the first ``count``, which are markers."""
    if len(held.vertices) == count:
        return None
    return Held(
        held.vertices[count:],
        held.directions[count:],
        held.share[count:],
        held.turning[count:],
        held.linked[:0],
        held.links[:, :0],
    )


def _links(surface: Surface, network: CellNetwork, points: Floats) -> tuple[Ints, Floats]:
    """Films that end in a marker, and how steps of their ends stretch their chords, (4, m)."""
    degrees = network.vertex_degrees
    film = np.flatnonzero((degrees[network.tails] == 2) | (degrees[network.heads] == 2))
    tail, head = points[network.tails[film]], points[network.heads[film]]
    chord = nearest_image(head - tail, surface.period)
    chord = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-300)
    ends = [-np.einsum("fix,fx->if", surface.vertex_frames(tail), chord)]
    ends.append(np.einsum("fix,fx->if", surface.vertex_frames(head), chord))
    return film, np.concatenate(ends)


def hold(held: Held, network: CellNetwork, length: float, arrays: tuple[Floats, Floats, Floats]) -> None:
    """Take the held directions out of forces, volume derivatives and Hessians, in place.

    Where a rim turns, a step along it turns too: the force across does work κ_g t²/2 on it.
    """
    force, volume, hessian = arrays
    where = np.full(network.n_vertices, -1)
    where[held.vertices] = np.arange(len(held.vertices))
    for row, ends in ((0, network.tails), (2, network.heads)):
        film = np.flatnonzero(where[ends] >= 0)
        index = where[ends[film]]
        t = held.directions[index].T
        project = np.eye(2)[..., None] - t[:, None] * t[None]
        rows = slice(row, row + 2)
        work = np.einsum("if,if->f", t, force[rows, film]) * held.turning[index] * length
        for array in (force, volume):
            array[rows, film] = np.einsum("ijf,jf->if", project, array[rows, film])
        block = hessian[:, :, film]
        block[rows] = np.einsum("ijf,jkf->ikf", project, block[rows])
        block[:, rows] = np.einsum("kjf,jif->kif", block[:, rows], project)
        block[rows, rows] += held.share[index] * t[:, None] * t[None] + work * project
        hessian[:, :, film] = block


def moved_points(surface: Surface, network: CellNetwork, points: Floats, steps: Floats) -> Floats:
    """Vertices moved by tangent ``steps`` (n, 2) in their frames; those on a rim stay on it."""
    moved = surface.retract(points, steps)
    if surface.rim is not None and len(network.rim_vertices):
        on = network.rim_vertices
        tangent = surface.rim.frame(*surface.rim.locate(points[on]))[0]
        ahead = np.einsum("ni,nix->nx", steps[on], surface.vertex_frames(points[on]))
        moved[on] = surface.rim.slide(points[on], np.einsum("nx,nx->n", ahead, tangent))
    return moved


def marker_tangents(surface: Surface, network: CellNetwork, points: Floats, offsets: Floats) -> Floats:
    """Direction of the film at each marker, in the vertex frame: (n_markers, 2) unit vectors."""
    markers = network.markers
    order = np.argsort(network.origin, kind="stable")
    first = order[np.searchsorted(network.origin[order], markers)]
    halves = np.stack([first, network.next[first ^ 1]], axis=1)
    tangents = outward_tangents(surface, network, points, offsets, halves)
    frames = surface.vertex_frames(points[markers])
    along = np.einsum("mij,mj->mi", frames, tangents[:, 0] - tangents[:, 1])
    out: Floats = along / np.linalg.norm(along, axis=1, keepdims=True)
    return out
