"""Bond-orientational order: ψ6 of every bubble and its frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpedfoam.analysis.frames import as_complex, oriented_frames, transported
from warpedfoam.arrays import Floats, as_choice, as_instance, frozen
from warpedfoam.foam import Foam

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class BondOrder:
    """Hexatic order of the bubbles.

    Attributes
    ----------
    psi6 : (n_bubbles,) complex array
        ψ6 in each bubble's own frame; its phase means nothing without the frame.
    frames : (n_bubbles, 2, 3) array
        Orthonormal tangent vectors e1, e2 at the centres, e2 counter-clockwise of e1.
    normals : (n_bubbles, 3) array
        Unit normals at the centres.
    """

    psi6: Complex
    frames: Floats
    normals: Floats

    @property
    def magnitude(self) -> Floats:
        """|ψ6|, 1 for a regular hexagon, whatever the frames."""
        return np.abs(self.psi6)

    @property
    def directions(self) -> Floats:
        """Unit tangent vectors (n_bubbles, 3) at angle arg(ψ6)/6: one of six directions to neighbours."""
        angle = np.angle(self.psi6) / 6.0
        out: Floats = np.cos(angle)[:, None] * self.frames[:, 0] + np.sin(angle)[:, None] * self.frames[:, 1]
        return out

    @property
    def mean_magnitude(self) -> float:
        """⟨|ψ6|⟩."""
        return float(self.magnitude.mean())


def bond_order(foam: Foam, *, weights: str = "length") -> BondOrder:
    """ψ6 of every bubble: ψ6 = Σ_f w_f e^{6iθ_f} / Σ_f w_f over its films f.

    θ_f is the direction of the outward normal of the film's chord, brought from the film's middle to the
    bubble's centre by parallel transport and measured in the frame there. With ``weights="length"``
    w_f is the chord's length, so a film that shrinks to nothing in a T1 leaves no jump; with ``"equal"``
    every film counts 1.

    Parameters
    ----------
    foam : Foam
    weights : {"length", "equal"}, optional

    Returns
    -------
    BondOrder

    Raises
    ------
    TypeError, ValueError
        If ``foam`` is not a Foam, or ``weights`` is none of the two.

    References
    ----------
    D. R. Nelson and B. I. Halperin, Phys. Rev. B 19, 2457 (1979); weights by length: W. Mickel et al.,
    J. Chem. Phys. 138, 044501 (2013).

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=100, seed=1)
    >>> order = bond_order(foam)
    >>> order.psi6.shape, bool(order.magnitude.max() <= 1.0)
    ((100,), True)
    """
    as_instance(foam, "foam", Foam)
    as_choice(weights, "weights", ("length", "equal"))
    network, surface, count = foam.network, foam.cell.surface, foam.n_bubbles
    normals, frames = oriented_frames(foam, foam.bubble_centres)
    tail, head = foam.film_ends
    chord, middle = head - tail, surface.project(tail + 0.5 * (head - tail))
    here = surface.normals(middle)
    chord = chord - np.einsum("fx,fx->f", chord, here)[:, None] * here
    length = np.linalg.norm(chord, axis=1)
    # the bubble left of the film sees its right-hand normal outwards; e^{6iθ} is the same for the other
    outward = np.cross(chord, here) / np.maximum(length, 1e-300)[:, None]
    top, bottom = np.zeros(count, dtype=np.complex128), np.zeros(count)
    weight = length if weights == "length" else np.ones(len(length))
    for bubble in (network.left, network.right):
        direction = as_complex(transported(outward, here, normals[bubble]), frames[bubble])
        np.add.at(top, bubble, weight * (direction / np.maximum(np.abs(direction), 1e-300)) ** 6)
        np.add.at(bottom, bubble, weight)
    return BondOrder(frozen(top / bottom), frozen(frames), frozen(normals))
