"""The paper's charts: tables hold what is drawn and what the theory says; pictures are written whole."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam import theory
from warpedfoam.plot import (
    figure_circles,
    figure_curvature,
    figure_gap,
    figure_spheres,
    figure_surface,
    figure_torus_energy,
)
from warpedfoam.plot.surface_pictures import torus_laplacian

FIGURES = {
    "curvature": figure_curvature,
    "gap": figure_gap,
    "spheres": figure_spheres,
    "torus": figure_torus_energy,
    "surface": figure_surface,
    "circles": figure_circles,
}


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_is_written_with_its_table(name, tmp_path):
    drawn = FIGURES[name]()
    sizes = {len(column) for column in drawn.table.values()}
    assert len(sizes) == 1
    assert all(np.isfinite(column).all() for column in drawn.table.values())
    picture, table = drawn.save(tmp_path / "a.png", dpi=50), drawn.write_csv(tmp_path / "a.csv")
    assert picture.stat().st_size > 5000
    with open(table, encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == list(drawn.table)
    last = [float(x) for x in rows[-1]]
    assert last == [column[-1] for column in drawn.table.values()]
    assert len(rows) == sizes.pop() + 1


def overlaps(one, two):
    return one.x0 < two.x1 and two.x0 < one.x1 and one.y0 < two.y1 and two.y0 < one.y1


def check_readable(figure, width):
    """As wide as asked for; letters of 6 points or more, on the figure, and none upon another panel's."""
    figure.draw_without_rendering()
    wide, tall = figure.get_size_inches()
    assert wide == pytest.approx(width / 25.4)
    texts = [t for t in figure.findobj(match=lambda a: hasattr(a, "get_fontsize")) if t.get_text()]
    shown = [t for t in texts if t.get_visible()]
    assert min(t.get_fontsize() for t in shown) >= 6.0
    box = figure.get_tightbbox()
    assert min(box.x0, box.y0) > -0.03
    assert max(box.x1 - wide, box.y1 - tall) < 0.03
    for axes in figure.axes:
        names = [axes.xaxis.label, axes.yaxis.label, *(axes.get_legend() or Nothing).get_texts()]
        boxes = [name.get_window_extent() for name in names if name.get_text()]
        for other in figure.axes:
            frame = other.get_window_extent()
            if other is not axes and other not in axes.child_axes and axes not in other.child_axes:
                assert not any(overlaps(box, frame) for box in boxes), (axes, other)


class Nothing:
    get_texts = staticmethod(list)


@pytest.mark.parametrize("width", [86.0, 180.0])
@pytest.mark.parametrize("name", FIGURES)
def test_figures_can_be_read_at_the_width_of_a_column(name, width):
    drawn, usual = FIGURES[name](width=width), FIGURES[name]()
    check_readable(drawn.figure, width)
    for column, values in usual.table.items():
        np.testing.assert_array_equal(drawn.table[column], values)
    if width < 130.0:
        # panels stand below each other, none in another
        boxes = [axes.get_window_extent() for axes in drawn.figure.axes]
        assert not any(overlaps(one, two) for k, one in enumerate(boxes) for two in boxes[:k])
        assert len({round(box.x0) for box in boxes[: 3 if name == "curvature" else 1]}) == 1
        assert not any(axes.child_axes for axes in drawn.figure.axes)


@pytest.mark.parametrize("width", [39.0, 1001.0, float("nan")])
def test_widths_out_of_range_are_refused(width):
    with pytest.raises(ValueError, match="width"):
        figure_gap(width=width)


def test_text_of_figures_stays_text(tmp_path):
    path = figure_gap(width=86.0).save(tmp_path / "gap.svg")
    text = path.read_text(encoding="utf-8")
    assert "balancing δd" in text
    assert "<text" in text


def drawn_lines(axes):
    return [np.asarray(line.get_xydata()) for line in axes.get_lines() if len(line.get_xdata()) > 50]


def test_the_lines_are_the_tables():
    drawn = figure_spheres(volumes=(0.4,))
    t = drawn.table
    cone, free = drawn_lines(drawn.figure.axes[0])
    np.testing.assert_array_equal(cone, np.stack([t["sphere_radius"] / 0.5, t["cone"]], axis=1))
    np.testing.assert_array_equal(free[:, 1], t["second_order"])
    np.testing.assert_allclose(t["cone"], theory.spherical_cone_ratio(0.4, 0.5, t["sphere_radius"]))
    drawn = figure_torus_energy(volumes=(0.5,))
    cylinder, free = drawn_lines(drawn.figure.axes[0])
    np.testing.assert_array_equal(cylinder[:, 1], drawn.table["cylinder"])
    np.testing.assert_array_equal(free[:, 1], drawn.table["second_order"])
    t, phi = drawn.table, np.radians(drawn.table["phi_degrees"])
    energy = theory.cylinder_energy(0.5, 0.5, theory.torus_gaussian_curvature(phi, 20.0, 4.0))
    np.testing.assert_allclose(t["cylinder"], energy / theory.flat_energy(0.5, 0.5), rtol=1e-13)
    t = figure_gap(tilts=(3e-4,)).table
    phi = np.radians(t["phi_degrees"])
    g = theory.torus_gaussian_curvature(phi, 20.0, 4.0)
    there = theory.cylinder_energy(0.5, 0.5, g) + theory.gap_energy_change(0.5, 0.5, 3e-4 * np.cos(phi))
    np.testing.assert_allclose(t["ratio"], there / theory.flat_energy(0.5, 0.5), atol=1e-7)
    t = figure_curvature().table
    np.testing.assert_allclose(t["relative_gap"], 0.5 * np.sqrt(np.abs(t["gaussian_curvature"])), rtol=1e-14)


def test_points_of_films_are_drawn_and_fitted():
    films = ([0.0, 90.0, 180.0], [0.5] * 3, [0.999517699, 1.000019111, 1.000791843])
    drawn = figure_torus_energy(points=films)
    dots = [line for line in drawn.figure.axes[0].get_lines() if line.get_marker() == "o"]
    np.testing.assert_array_equal(dots[0].get_xydata(), np.array([films[0], films[2]]).T)
    inset = drawn.figure.axes[0].child_axes[0]
    fitted = next(line for line in inset.get_lines() if line.get_marker() == "o")
    g = theory.torus_gaussian_curvature(np.radians(films[0]), 20.0, 4.0)
    assert fitted.get_ydata()[0] == pytest.approx(theory.fit_delta(films[2], 0.5, 0.5, g))
    # films and theory lead to nearly the same Δ
    assert fitted.get_ydata()[0] == pytest.approx(
        drawn.table["delta"][drawn.table["volume"] == 0.5][0], abs=0.01
    )


def test_circles_hold_perimeters_of_the_surface():
    t = figure_circles(2.0, (180.0,)).table
    assert len(t["radius"]) == 10
    want = wf.geodesic_circle(wf.Torus(20.0, 4.0), [16.0, 0.0, 0.0], 2.0).perimeter
    assert t["perimeter"][-1] == pytest.approx(want, rel=1e-11)
    assert abs(t["three_terms"][-1] - want) < 0.2 * abs(t["two_terms"][-1] - want)


def test_laplacian_of_the_torus():
    torus, h = wf.Torus(3.0, 1.0), 1e-3
    x = torus.random_points(20, 3)
    phi = torus.angles(x)[0]

    def g(f):
        return theory.torus_gaussian_curvature(f, 3.0, 1.0)

    w = 3.0 + np.cos(phi)
    second, first = (g(phi + h) - 2 * g(phi) + g(phi - h)) / h**2, (g(phi + h) - g(phi - h)) / (2 * h)
    want = second - np.sin(phi) / w * first
    found = [torus_laplacian(float(f), 3.0, 1.0) for f in phi]
    np.testing.assert_allclose(found, want, atol=1e-5)


@pytest.mark.parametrize(
    ("call", "fault", "says"),
    [
        (lambda: figure_spheres(gap=0.0), ValueError, "gap must be greater than 0"),
        (lambda: figure_spheres(points=([1.0], [0.5])), TypeError, "points must be three arrays"),
        (lambda: figure_spheres(points=([1.0], [0.5, 0.6], [1.0])), ValueError, "points.1. must have shape"),
        (lambda: figure_torus_energy(volumes=(0.5, -1.0)), ValueError, "volume must be greater than 0"),
        (lambda: figure_curvature(major_radius=1.0), ValueError, "major_radius must exceed"),
        (lambda: figure_gap(tilts=(-1.0,)), ValueError, "must leave a gap"),
        (lambda: figure_surface(wf.Torus), TypeError, "surface must be a surface"),
        (lambda: figure_circles(14.0), ValueError, "crosses itself"),
        (lambda: figure_gap().save("a.gif"), ValueError, "must end in .png"),
        (lambda: figure_gap().write_csv("a.txt"), ValueError, "must end in .csv"),
    ],
)
def test_bad_arguments(call, fault, says):
    with pytest.raises(fault, match=says):
        call()
