"""Geodesic 120° nets on the sphere: given topology and areas, lengths and pressures are closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf

from .nets import NETS, Net, hemispheres, lunes

GAP = 1e-3


@pytest.mark.parametrize("net", NETS, ids=lambda net: net.name)
def test_length_and_equal_pressures(net: Net) -> None:
    """At high order every net has its closed-form length (1e-9) and equal pressures (1e-8)."""
    result = wf.relax(net.foam(GAP, order=net.check_order), t1=False)
    assert result.converged, result.message
    length = result.foam.film_lengths.sum()
    assert abs(length / net.length - 1.0) < 1e-9
    assert np.ptp(result.pressures) < 1e-8
    lift = GAP + GAP**2 / 2.0
    assert result.energy == pytest.approx(lift * length, rel=1e-12)


@pytest.mark.parametrize("net", [net for net in NETS if net.n_bubbles >= 6], ids=lambda net: net.name)
def test_default_order(net: Net) -> None:
    """At the default order the nets from the cube up are right to 1e-6."""
    result = wf.relax(net.foam(GAP, order=4), t1=False)
    assert result.converged
    assert abs(result.foam.film_lengths.sum() / net.length - 1.0) < 1e-6
    assert np.ptp(result.pressures) < 1e-6


@pytest.mark.parametrize("net", NETS, ids=lambda net: net.name)
def test_film_lengths(net: Net) -> None:
    """The films have the lengths of the table, each as often as it says."""
    result = wf.relax(net.foam(GAP, order=net.check_order), t1=False)
    wanted = np.sort(np.concatenate([np.full(count, length) for length, count in net.films]))
    assert np.abs(np.sort(result.foam.film_lengths) - wanted).max() < 2e-6


def test_two_hemispheres() -> None:
    """A closed film with markers is a great circle: length 2π, equal pressures, charges 6 + 6."""
    result = wf.relax(hemispheres(GAP, n_markers=4, order=12, tilt=0.2), t1=False)
    assert result.converged, result.message
    assert result.foam.film_lengths.sum() == pytest.approx(2.0 * np.pi, rel=1e-11)
    assert np.ptp(result.pressures) < 1e-10
    assert result.foam.network.charges.tolist() == [6, 6]


def test_three_lunes() -> None:
    """Three meridians, each divided by a marker: length 3π, angles of 120° at both poles."""
    result = wf.relax(lunes(GAP, order=14, noise=0.1), t1=False)
    assert result.converged, result.message
    assert result.foam.film_lengths.sum() == pytest.approx(3.0 * np.pi, rel=1e-9)
    assert np.ptp(result.pressures) < 1e-8
    assert wf.equilibrium_report(result.foam).angle_error < 1e-6


def test_cap() -> None:
    """One small bubble in the sphere's rest: L² = 4πA − G A² (exact for constant G)."""
    share = 0.1
    foam = hemispheres(GAP, n_markers=6, order=14, tilt=0.0, share=share)
    result = wf.relax(foam, t1=False)
    assert result.converged, result.message
    area = result.foam.bubble_areas[0]
    assert area == pytest.approx(4.0 * np.pi * share, rel=1e-12)
    assert result.foam.film_lengths.sum() == pytest.approx(np.sqrt(4 * np.pi * area - area**2), rel=1e-10)


@pytest.mark.parametrize(("n_markers", "order"), [(4, 8), (4, 12), (5, 8)])
def test_few_markers(n_markers: int, order: int) -> None:
    """Few markers on a closed film: no drift by quadrature's torque, right to the order's accuracy."""
    result = wf.relax(hemispheres(GAP, n_markers=n_markers, order=order, tilt=0.0, share=0.1), t1=False)
    assert result.converged, result.message
    area = result.foam.bubble_areas[0]
    assert result.foam.film_lengths.sum() == pytest.approx(np.sqrt(4 * np.pi * area - area**2), rel=1e-3)
