"""Single bubbles where the gap varies: closed forms of energy and force, and gap against curvature."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from .gap_samples import PLATE, flat_plate


def test_a_bubble_in_a_wedge_is_pushed_to_the_narrow_side():
    """F = −s (E0/2d)(1 + 5ρ²s²/8d²): what either order leaves out falls like s² and s⁴."""
    left, slopes = [], (0.2, 0.1, 0.05)
    plate = flat_plate(8.0)
    for slope in slopes:
        cell = wf.HeleShawCell(plate, wf.LinearGap(1.0, (slope, 0.0, 0.0)))
        held = wf.cluster_potential(cell, 1, volumes=1.0, points=[[0.0, 0.0, 0.0]], order=10)
        energy, force = held.energies[0], held.forces[0]
        flat = 2.0 * np.sqrt(np.pi)
        assert force[0] < 0.0
        assert abs(force[1]) < 1e-9
        square = slope**2 / np.pi
        left.append(
            [
                force[0] / (-0.5 * flat * slope) - 1.0,
                force[0] / (-0.5 * flat * slope * (1.0 + 0.625 * square)) - 1.0,
                energy / flat - 1.0,
                energy / wf.theory.varying_gap_energy(1.0, 1.0, slope) - 1.0,
            ]
        )
    rates = np.log2(np.abs(np.divide(left[:-1], left[1:])))
    np.testing.assert_allclose(rates[-1], [2.0, 4.0, 2.0, 4.0], atol=0.2)


def test_the_force_in_a_wedge_is_minus_the_slope_of_the_energy():
    cell = wf.HeleShawCell(flat_plate(8.0), wf.LinearGap(1.0, (0.1, 0.0, 0.0)))
    h = 0.05
    points = np.zeros((5, 3))
    points[:, 0] = 0.4 + h * np.arange(-2, 3)
    held = wf.cluster_potential(cell, 1, volumes=1.0, points=points, tolerance=1e-11)
    e = held.energies
    slope = (8.0 * (e[3] - e[1]) - (e[4] - e[0])) / (12.0 * h)
    assert held.forces[2, 0] == pytest.approx(-slope, rel=1e-7)


def test_a_bubble_in_a_saucer():
    """d = 1 + b r²/2 + …: at the middle the energy is that of Δd = 2b, to fourth order."""
    left = []
    for bend in (0.1, 0.05):
        cell = wf.HeleShawCell(PLATE, wf.FormulaGap(f"1 + {bend}*(x**2 + y**2)/2"))
        held = wf.cluster_potential(cell, 1, volumes=1.0, points=[[0.0, 0.0, 0.0]])
        assert np.abs(held.forces).max() < 1e-9
        left.append(held.energies[0] / wf.theory.varying_gap_energy(1.0, 1.0, 0.0, 2.0 * bend) - 1.0)
    assert abs(left[1]) < 5e-5
    assert np.log2(left[0] / left[1]) == pytest.approx(2.0, abs=0.1)


def test_a_free_bubble_comes_to_rest_where_the_gap_is_least():
    """Pulled to the middle of a saucer, from aside, and a cluster keeps its volumes on the way."""
    cell = wf.HeleShawCell(PLATE, wf.FormulaGap("1 + 0.02*(x**2 + y**2)"))
    free = wf.relax(wf.cluster_foam(cell, 1, volumes=1.0, centre=[1.0, 0.5, 0.0]))
    assert free.converged, free.message
    assert free.foam.bubble_volumes[0] == pytest.approx(1.0, rel=1e-12)
    curve = free.foam.film_curves(9).reshape(-1, 3)
    radius = np.linalg.norm(curve, axis=1)
    np.testing.assert_allclose(radius, radius.mean(), rtol=1e-3)
    assert np.abs(free.foam.bubble_centres[0]).max() < 5e-3


def balancing_shift(scale):
    """Outward shift of the tube that stops a bubble of V = d = 0.5 on top of a torus (20, 4) · scale."""
    torus = wf.Torus(20.0 * scale, 4.0 * scale)
    top = torus.points(np.array([0.5 * np.pi]), np.zeros(1))
    up = torus.vertex_frames(top)[0, 0]
    paper = float(wf.theory.balancing_gap_change(0.5, 1.0 / (80.0 * scale**2)))

    def force(shift):
        cell = wf.HeleShawCell(torus, wf.ShiftedTubeGap(torus, 0.5, outward=shift))
        return float(wf.cluster_potential(cell, 1, volumes=0.5, points=top).forces[0] @ up)

    # linear in the shift but for parts in a million
    a, b = 0.9 * paper, paper
    return a - force(a) * (b - a) / (force(b) - force(a)), paper


def test_the_gap_that_balances_curvature():
    """Not GV/3π: what second-order theory leaves out falls with the square of the curvature."""
    left = []
    for scale in (1.0, 2.0):
        shift, paper = balancing_shift(scale)
        better = (
            (0.75 + 5.0 * np.pi * 0.5**3 / 8.0) * 0.5 / (3.0 * np.pi * (4.0 * scale + 0.25) * 20.0 * scale)
        )
        phi = 0.5 * np.pi + np.array([-0.01, 0.01])
        ends = wf.theory.second_order_balance(
            0.5, 0.5, *wf.theory.torus_curvatures(phi, 20.0 * scale, 4.0 * scale), film="ruled"
        )
        assert (ends[0] - ends[1]) / 0.02 == pytest.approx(better, rel=2e-4)
        assert abs(shift / better - 1.0) < 0.1 * abs(shift / paper - 1.0)
        left.append(shift / better - 1.0)
    assert left[0] / left[1] == pytest.approx(4.0, abs=0.3)


def test_the_page():
    """The Python of docs/gaps.md runs, and its numbers are those of the tables."""
    text = (Path(__file__).parents[1] / "docs" / "gaps.md").read_text(encoding="utf-8")
    space = {"__name__": "__main__"}
    for block in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        exec(compile(block, "gaps.md", "exec"), space)
    assert space["report"].angle_error < 1e-3
    assert float(space["held"].forces[0, 0]) == pytest.approx(-0.1775998, abs=1e-7)
    assert "| 0.1 | −0.1775998 |" in text


def test_a_bubble_drifts_down_a_wedge():
    """F = s √(πV/d) against the drag λ π ρ d per speed: d ẋ = −γ s/λ, wherever it is."""
    slope = 0.1
    cell = wf.HeleShawCell(flat_plate(8.0), wf.LinearGap(1.0, (slope, 0.0, 0.0)))
    start = wf.cluster_foam(cell, 1, volumes=1.0, centre=[[2.0, 0.0, 0.0]])
    moved = wf.drift(start, friction=2.0, duration=4.0, every=1.0, tolerance=1e-3)
    x = np.array([foam.bubble_centres[0, 0] for foam in moved.foams])
    covered = np.diff(x + 0.5 * slope * x**2)[1:]
    np.testing.assert_allclose(covered, -0.5 * slope, rtol=5e-3)
    assert moved.volume_errors.max() < 1e-10
    assert (np.diff(moved.step_energies) < 0.0).all()


@pytest.mark.parametrize("formula", ["9**9**9**9", "1/0", "(-1)**0.5", "x/0", "log(0)", "1e400"])
def test_formulas_without_a_finite_value_are_refused(formula):
    with pytest.raises(ValueError, match="gap must be finite"):
        wf.HeleShawCell(wf.Sphere(1.0), wf.FormulaGap(formula))
