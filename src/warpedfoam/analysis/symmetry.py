"""`point_group`: the rotations and reflections that map a foam to itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from warpedfoam.arrays import Bools, Floats, as_instance, as_number, frozen
from warpedfoam.foam import Foam

#: Film points compared besides the vertices.
ALONG = np.array([0.25, 0.5, 0.75])
#: Coordinates compared at once.
BLOCK = 3_000_000


@dataclass(frozen=True, eq=False)
class PointGroup:
    """The finite group of orthogonal matrices under which a foam stays as it is.

    Attributes
    ----------
    name : str
        Schoenflies symbol, such as ``"Ih"``, ``"D3h"``, ``"C1"``.
    order : int
        Number of elements.
    matrices : (order, 3, 3) array
        The elements, rotations first.
    error : float
        Largest distance by which an element misses, in bubble sizes.
    """

    name: str
    order: int
    matrices: Floats
    error: float

    @property
    def n_rotations(self) -> int:
        """Number of proper rotations, the identity included."""
        return int((np.linalg.det(self.matrices) > 0.0).sum())


def point_group(foam: Foam, *, tolerance: float = 1e-5) -> PointGroup:
    """Find the symmetries of a foam about the origin.

    A symmetry takes the first film's start and tangent, or any other's, to those of some half-film, with
    the same or the opposite handedness: 4 F candidate matrices. Those count which map the vertices and
    three points on each film to such points.

    Parameters
    ----------
    foam : Foam
        Threefold, without marker vertices, on a surface that does not repeat in space, about the origin.
    tolerance : float, optional
        Largest distance between a point and the image that it should be, in bubble sizes.

    Returns
    -------
    PointGroup

    Raises
    ------
    TypeError, ValueError
        If ``foam`` is not a Foam, has marker vertices, or its surface repeats or ends in a rim.

    Notes
    -----
    O(F² log F) time.

    Examples
    --------
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> group = point_group(Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops))
    >>> group.name, group.order
    ('Td', 24)
    """
    as_instance(foam, "foam", Foam)
    limit = as_number(tolerance, "tolerance", positive=True, maximum=0.1) * foam.bubble_size
    network, surface = foam.network, foam.cell.surface
    if surface.period is not None or surface.rim is not None:
        raise ValueError("foam must lie on a closed surface that does not repeat in space")
    if (network.vertex_degrees != 3).any():
        raise ValueError("foam must have no marker vertices: they are no part of its shape")
    points = np.concatenate([foam.vertex_points, foam.film_curves_at(ALONG).reshape(-1, 3)])
    frames = _frames(foam)
    matrices, errors = _symmetries(points, frames, limit)
    rotations = np.linalg.det(matrices) > 0.0
    order = np.argsort(~rotations, kind="stable")
    matrices = matrices[order]
    return PointGroup(
        schoenflies(matrices), len(matrices), frozen(matrices), float(errors.max() / foam.bubble_size)
    )


def _frames(foam: Foam) -> Floats:
    """Right-handed frames (2 F, 3, 3) as rows: normal at the start, direction to the other end."""
    tail, head = foam.film_ends
    start = np.stack([tail, head], axis=1).reshape(-1, 3)
    end = np.stack([head, tail], axis=1).reshape(-1, 3)
    n = foam.cell.surface.normals(start)
    along = end - start
    along -= np.einsum("ij,ij->i", along, n)[:, None] * n
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([n, along, np.cross(n, along)], axis=1)


def _symmetries(points: Floats, frames: Floats, limit: float) -> tuple[Floats, Floats]:
    """Different matrices that map the points to themselves, (k, 3, 3), and by how much they miss."""
    mirrored = frames * np.array([1.0, 1.0, -1.0])[:, None]
    trials = np.einsum("kri,rj->kij", np.concatenate([frames, mirrored]), frames[0])
    tree = cKDTree(points)
    # few points refuse most candidates
    few = points[:: max(1, len(points) // 16)]
    trials = trials[_misses(tree, few, trials) <= limit]
    error = _misses(tree, points, trials)
    trials, error = trials[error <= limit], error[error <= limit]
    apart = np.abs(trials[:, None] - trials[None]).max(axis=(2, 3)) > 1e-3
    first: Bools = np.array([apart[i, :i].all() for i in range(len(trials))])
    return trials[first], error[first]


def _misses(tree: cKDTree, points: Floats, trials: Floats) -> Floats:
    """Largest distance from an image of the points to the nearest point, (k,)."""
    step = max(1, BLOCK // (3 * len(points)))
    out = []
    for first in range(0, len(trials), step):
        images = np.einsum("kij,pj->kpi", trials[first : first + step], points)
        out.append(np.asarray(tree.query(images)[0]).max(axis=1))
    return np.concatenate(out) if out else np.zeros(0)


def schoenflies(matrices: Floats) -> str:
    """Name of a finite group of orthogonal matrices (k, 3, 3).

    Examples
    --------
    >>> schoenflies(np.stack([np.eye(3), -np.eye(3)]))
    'Ci'
    """
    sign = np.where(np.linalg.det(matrices) > 0.0, 1, -1)
    proper = matrices[sign > 0]
    # of the rotation by 2π k/m: m from its angle, and its axis
    angles = np.arccos(np.clip((np.trace(proper, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    fold = np.array([_fold(a) for a in angles])
    count, top = len(proper), int(fold.max())
    improper = matrices[sign < 0]
    inverted = bool((np.abs(improper + np.eye(3)).max(axis=(1, 2), initial=0.0) < 1e-3).any())
    mirrors = improper[np.abs(np.trace(improper, axis1=1, axis2=2) - 1.0) < 1e-3]
    if count == 60:
        return "Ih" if len(improper) else "I"
    if count == 24 and top == 4:
        return "Oh" if len(improper) else "O"
    if count == 12 and top == 3:
        return ("Th" if inverted else "Td") if len(improper) else "T"
    axis = _axis(proper[int(fold.argmax())]) if top > 1 else None
    across = len(mirrors) if axis is None else int((np.abs(mirrors @ axis + axis).max(axis=1) < 1e-3).sum())
    if count == 2 * top:
        if top == 2 and len(improper) and not _involutions(improper):
            # D2d: of the three twofold axes the main one is where S4 turns
            return "D2d"
        kind = "" if not len(improper) else "h" if across else "d"
        return f"D{top}{kind}"
    if top == 1:
        return "C1" if not len(improper) else "Cs" if across else "Ci"
    if not len(improper):
        return f"C{top}"
    return f"C{top}h" if across else f"C{top}v" if len(mirrors) else f"S{2 * top}"


def _involutions(improper: Floats) -> bool:
    """Whether all improper elements of a group over D2 are mirrors or the inversion, as in D2h."""
    square = improper @ improper
    return bool((np.abs(square - np.eye(3)).max(axis=(1, 2)) < 1e-3).all())


def _fold(angle: float) -> int:
    """Least m with m · angle a whole number of turns."""
    if angle < 1e-3:
        return 1
    turns = angle / (2.0 * np.pi)
    whole = np.arange(1, 1000)
    return int(whole[np.argmax(np.abs(whole * turns - np.round(whole * turns)) < 1e-3)])


def _axis(rotation: Floats) -> Floats:
    """Unit vector that a rotation leaves."""
    values, vectors = np.linalg.eig(rotation)
    out: Floats = np.real(vectors[:, np.argmin(np.abs(values - 1.0))])
    return out / np.linalg.norm(out)
