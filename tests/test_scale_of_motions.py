"""Rigid motions are recognised whatever the unit of length: millimetres of a drawing are no other foam."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.relax.system import State, pinned_unknowns


@pytest.mark.parametrize("scale", [1e-7, 1.0, 1e5])
def test_a_turn_about_the_axis_is_pinned_at_any_size(scale: float) -> None:
    """A spheroid turns into itself: one unknown is pinned, or Newton's last steps go astray."""
    cell = wf.HeleShawCell(wf.Ellipsoid(scale, scale, 1.4 * scale), gap=0.05 * scale)
    foam = wf.voronoi_foam(cell, 24, seeds="lattice")
    state = State(foam.network, foam.vertex_points, foam.film_offsets, np.zeros(foam.n_bubbles))
    assert len(pinned_unknowns(cell, state)) == 1


def test_the_same_foam_in_other_units() -> None:
    found = []
    for scale in (1.0, 1e5):
        cell = wf.HeleShawCell(wf.Ellipsoid(scale, scale, 1.4 * scale), gap=0.05 * scale)
        relaxed = wf.relax(wf.voronoi_foam(cell, 24, seeds="lattice"))
        assert relaxed.converged
        found.append((relaxed.energy / scale**2, relaxed.n_t1))
    assert found[0][0] == pytest.approx(found[1][0], rel=1e-9)
    assert np.isclose(found[0][1], found[1][1])
