"""A gap that varies, checked against the inner plate that carries it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpedfoam.arrays import Floats, as_floats, frozen
from warpedfoam.kernels.differences import best_step, differences
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.gap_field import (
    Function,
    FunctionGap,
    GapField,
    Profile,
    gap_values,
    positive_gap,
    shown,
)
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.level_twins import level_twin, without_twin
from warpedfoam.surfaces.protocol import SIZES, Surface

#: Points where derivatives are looked at; errors of the gradient that differences may have, and that a
#: gradient or second derivatives of the user's may have, in units of the gap's range over the plate's size.
SAMPLES, ROUGH, WRONG, BENT = 200, 1e-6, 1e-4, 1e-2
#: Relative change after a period that is round-off.
REPEATS = 1e-9


@dataclass(frozen=True, eq=False)
class FittedGap:
    """A gap on its plate.

    ``field`` has derivatives; ``surface`` is the plate with arcs that can follow the gap; ``points`` (n, 3),
    ``weights`` (n,) are a quadrature of the plate and ``values`` (n,) the gap there.
    """

    field: GapField
    surface: LevelSurface
    points: Floats
    weights: Floats
    values: Floats

    @cached_property
    def mean(self) -> float:
        """∫ d dA over the plate's area."""
        return float(self.weights @ self.values / self.weights.sum())

    @cached_property
    def profile(self) -> Profile:
        """The gap over its mean."""
        return Profile(self.field, self.mean, frozen(self.points[0]))

    @cached_property
    def symmetries(self) -> Floats:
        """Combinations (k, m) of the plate's m rigid motions that leave the gap as it is."""
        return self._kept(self.surface.rigid_motions(self.points))

    @cached_property
    def _free_symmetries(self) -> Floats:
        return self._kept(self.surface.free_motions(self.points))

    def _kept(self, motions: Floats) -> Floats:
        """Combinations (k, m) of m motions (m, n, 3) at the points that leave the gap as it is.

        A motion v does if v · ∇ ln d is small everywhere, against |v| over the plate's size.
        """
        from scipy.linalg import eigh

        if not len(motions):
            return np.zeros((0, 0))
        slope = self.profile.gradients(self.points) / (self.values / self.mean)[:, None]
        change = self.surface.size * np.einsum("knx,nx->kn", motions, slope)
        moved = (change * self.weights) @ change.T
        whole = np.einsum("n,anx,bnx->ab", self.weights, motions, motions)
        values, vectors = eigh(moved, whole)
        out: Floats = vectors[:, values < self.surface.symmetry].T
        return frozen(out)

    def free_motions(self, points: Floats) -> Floats:
        """`rigid_motions` of what touches no rim, which need not stay where it is."""
        if not len(self._free_symmetries):
            return np.zeros((0, *points.shape))
        out: Floats = np.einsum("ka,anx->knx", self._free_symmetries, self.surface.free_motions(points))
        return out

    def rigid_motions(self, points: Floats) -> Floats:
        """Velocities (k, n, 3) of the motions that leave both plates where they are."""
        if not len(self.symmetries):
            return np.zeros((0, *points.shape))
        out: Floats = np.einsum("ka,anx->knx", self.symmetries, self.surface.rigid_motions(points))
        return out


def fitted_gap(surface: Surface, gap: Function) -> FittedGap | float:
    """Check a gap on a plate; a number if it is the same everywhere.

    Raises
    ------
    TypeError, ValueError
        If the values are not finite, above 0 and of shape (n,); if the plates fold somewhere; if the gap does
        not repeat where the plate does, is too rough to be differentiated, or has wrong derivatives.
    """
    if isinstance(gap, type):
        raise TypeError(f"gap must be a number or a function of points, got the class {gap.__name__}")
    plate = without_twin(surface)
    made_for = getattr(gap, "surface", None)
    if made_for is not None and made_for != plate:
        raise ValueError(f"gap belongs to {made_for!r}, but the inner plate is {plate!r}")
    nodes = surface.mesh.nodes
    seen = positive_gap(gap, nodes)
    if (seen == seen[0]).all():
        return float(seen[0])
    if seen.max() > SIZES["maximum"]:
        raise ValueError(f"gap must be at most {SIZES['maximum']:g}, got {seen.max():g}")
    twin = level_twin(surface)
    _require_period(gap, nodes, twin.period)
    field = _with_derivatives(gap, nodes[:: max(1, len(nodes) // SAMPLES)], twin.size, float(np.ptp(seen)))
    rule = twin.quadrature()
    values = positive_gap(field, rule.points)
    trace = np.einsum("nxx->n", rule.shapes)
    square = np.einsum("nxy,nxy->n", rule.shapes, rule.shapes)
    # (k1 − k2)²/4 = tr W²/2 − (tr W)²/4
    least = 0.5 * trace - np.sqrt(np.maximum(0.5 * square - 0.25 * trace**2, 0.0))
    room = 1.0 + values * least
    if not (room > 1e-12).all():
        bad = int(np.argmin(room))
        raise ValueError(
            f"gap folds the outer plate at {shown(rule.points[bad])}: it is {values[bad]:.4g} there, and "
            f"must be less than {-1.0 / least[bad]:.4g}, the least radius of curvature on the side of the gap"
        )
    return FittedGap(field, twin, frozen(rule.points), frozen(rule.weights), frozen(values))


def _require_period(gap: Function, nodes: Floats, period: Floats | None) -> None:
    """The gap repeats where the plate does."""
    if period is None:
        return
    some = nodes[:: max(1, len(nodes) // SAMPLES)]
    some = nearest_image(some, period)
    here = gap_values(gap, some)
    for axis in np.flatnonzero(np.isfinite(period)):
        way = period[axis] * np.eye(3)[axis]
        off = np.abs(gap_values(gap, some + way) - here)
        if off.max() > REPEATS * here.max():
            raise ValueError(
                f"gap does not repeat after {shown(way)}, where the plate does: it differs by "
                f"{off.max():.3g}; take a function of that period, or a plate that ends (Graph, Cylinder)"
            )


def _with_derivatives(gap: Function, points: Floats, size: float, spread: float) -> GapField:
    """The gap with derivatives that were looked at."""

    def raw(at: Floats) -> Floats:
        return np.asarray(gap(at), dtype=np.float64).reshape(len(at))

    step, error = best_step(raw, points, size)
    if not isinstance(gap, GapField):
        # round-off in the values is not the function's fault
        floor = 1e-14 * float(np.abs(gap_values(gap, points)).max()) / step
        if error > max(ROUGH * spread / size, 1e3 * floor):
            raise ValueError(
                f"gap is too rough to be differentiated: its gradient changes by {error:.2g} with the step "
                "of differences; give a function that is smooth on the plate and a little off it, or a gap "
                "with gradient and hessian (GapField)"
            )
        return gap if isinstance(gap, FunctionGap) else FunctionGap(gap, step)
    if isinstance(gap, FunctionGap):
        return gap
    _, slope, bend = differences(raw, points, step, second=True)
    given = as_floats(gap.gradient(points.copy()), "gap's gradient", (len(points), 3))
    bent = as_floats(gap.hessian(points.copy()), "gap's hessian", (len(points), 3, 3))
    assert bend is not None
    scale = max(float(np.abs(slope).max()), spread / size)
    _require_equal("gradient", given, slope, WRONG * scale + 2.0 * error, points)
    curved = max(float(np.abs(bend).max()), scale / size)
    _require_equal("hessian", bent, bend, BENT * curved + 10.0 * error / step, points)
    return gap


def _require_equal(name: str, given: Floats, found: Floats, allowed: float, points: Floats) -> None:
    fault = np.abs(given - found).reshape(len(points), -1).max(axis=1)
    if not (fault <= allowed).all():
        bad = int(np.argmax(fault))
        raise ValueError(
            f"gap's {name} is not that of its values: at {shown(points[bad])} it differs by "
            f"{fault[bad]:.3g} from central differences"
        )
