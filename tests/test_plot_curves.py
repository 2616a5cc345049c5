"""Curves and histograms: what they show is what was computed, and they can be read in print."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from warpedfoam import (
    Cylinder,
    HeleShawCell,
    Relaxation,
    Sphere,
    Torus,
    anneal,
    bond_order,
    cluster_foam,
    equilibrium_report,
    foam_statistics,
    geometric_potential,
    plot_annealing,
    plot_charge_energies,
    plot_charge_profile,
    plot_correlations,
    plot_defects,
    plot_foam,
    plot_histogram,
    plot_map,
    plot_order,
    plot_potential,
    plot_potential_path,
    plot_relaxation,
    plot_sides,
    read_study,
    relax,
    run_ensemble,
    save_figure,
    voronoi_foam,
)
from warpedfoam.io.patches import bubble_patches
from warpedfoam.plot.painting import default_view
from warpedfoam.plot.projection import View
from warpedfoam.plot.style import Style

from .io_foams import bubble_on_torus, sphere_foam, torus_foam, with_pressures


@cache
def quench() -> Relaxation:
    """Random bubbles, with T1s on the way."""
    return relax(voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=80, seed=3))


@cache
def path_potential(method: str):
    torus = Torus(20.0, 4.0)
    path = torus.points(np.linspace(0.0, np.pi, 41), np.zeros(41))
    return geometric_potential(HeleShawCell(torus, gap=0.5), 0.5, path=path, method=method)


# ------------------------------------------------------------------ history of a relaxation


def test_the_history_ends_in_the_result() -> None:
    one = quench()
    history = one.history
    assert one.converged
    assert one.n_t1 > 3
    assert history.energy[-1] == pytest.approx(one.energy, rel=1e-13)
    assert (history.residual[-1], history.volume_error[-1]) == (one.residual, one.volume_error)
    assert history.iteration[-1] == one.iterations
    assert history.n_t1[-1] == one.n_t1
    np.testing.assert_array_equal(np.diff(history.iteration) > 0, True)
    assert history.exact[-1]
    assert not history.exact[0]
    for array in vars(history).values():
        assert len(array) == len(history.iteration)
        assert not array.flags.writeable


def test_no_t1s_are_a_line_on_the_ground() -> None:
    one = relax(sphere_foam(12, even=True), t1=False)
    right = plot_relaxation(one).axes[2]
    assert right.get_ylim()[0] > -0.1
    assert right.get_ylim()[1] >= 1.0


@pytest.mark.parametrize("values", [120.0 + 1e-3 * np.arange(40.0), -7.0 - 2e-5 * np.arange(30.0) ** 2])
def test_values_that_differ_by_little_are_shown_less_a_number(values: np.ndarray) -> None:
    """Bars and mean are where they were, once what the axis says is added; no offset stands beside it."""
    axes = plot_histogram(values, label="angle", width=86.0).axes[0]
    said = re.fullmatch(r"angle ([−+]) ([\d.]+)", axes.get_xlabel())
    assert said is not None
    shift = float(said[2]) * (1.0 if said[1] == "−" else -1.0)
    left = axes.patches[0].get_x() + shift
    assert left == pytest.approx(values.min(), rel=1e-12)
    assert axes.lines[0].get_xdata()[0] + shift == pytest.approx(values.mean(), rel=1e-12)
    assert f"mean {values.mean():.4g}" in axes.get_title()
    axes.figure.draw_without_rendering()
    assert axes.xaxis.get_offset_text().get_text() == ""
    assert plot_histogram(np.arange(40.0), label="angle").axes[0].get_xlabel() == "angle"


def test_equal_areas_have_no_slope_of_lewis() -> None:
    found = relax(voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=20, seed=1)).foam
    axes = plot_sides(foam_statistics(found)).axes[2]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["measured", "all areas equal"]
    assert axes.get_ylim() == (0.9, 1.1)


def test_bubbles_at_walls_are_grey_bars() -> None:
    """Their charge is 6 − films − 2 walls: the colour of their sides would be another charge's."""
    foam = voronoi_foam(HeleShawCell(Cylinder(1.0, 3.0), gap=0.01), n_bubbles=30, seed=1)
    found, walls = foam_statistics(foam), foam.network.wall_counts > 0
    assert 0 < walls.sum() == found.at_walls.sum() < 30
    bars = plot_sides(found).axes[0].patches
    inner, outer = bars[: len(found.sides)], bars[len(found.sides) :]
    for n, low, high in zip(found.sides, inner, outer, strict=True):
        same = foam.network.sides == n
        assert low.get_height() == pytest.approx((same & ~walls).sum() / 30)
        assert high.get_height() == pytest.approx((same & walls).sum() / 30)
        assert high.get_y() == pytest.approx(low.get_height())
        assert np.ptp(high.get_facecolor()[:3]) < 1e-12
    assert f"grey: {walls.sum()} at walls" in plot_sides(found).axes[0].get_title()
    closed = plot_sides(foam_statistics(sphere_foam(60))).axes[0]
    assert "grey" not in closed.get_title()
    # Σ of all bubbles' neighbours' sides, every film seen from both of its sides, rim or not
    network = foam.network
    sums = np.bincount(network.left, network.sides[network.right], 30)
    sums += np.bincount(network.right, network.sides[network.left], 30)
    films = np.bincount(network.left, minlength=30) + np.bincount(network.right, minlength=30)
    for k, n in enumerate(found.sides):
        same = network.sides == n
        assert found.neighbour_sides[k] == pytest.approx(sums[same].sum() / films[same].sum(), rel=1e-12)


def test_an_exterior_is_grey_and_no_bubble() -> None:
    foam = cluster_foam(HeleShawCell(Torus(3.0, 1.2), 0.1), 3, volumes=0.1, centre=[0.0, -4.2, 0.0])
    order, kinds = plot_order(foam), plot_defects(foam)
    assert order.axes[0].get_title().startswith("3 bubbles, mean")
    assert kinds.axes[0].get_title().startswith("3 bubbles, ")
    inside = np.delete(bond_order(foam).magnitude, foam.exterior)
    assert order.axes[0].get_title().endswith(f"{inside.mean():.3f}")
    fills = order.axes[0].collections[0].get_facecolors()[:, :3]
    # most of the torus is grey of some brightness
    assert (np.ptp(fills, axis=1) < 1e-9).mean() > 0.5
    # the cluster is seen from its front
    patches = bubble_patches(foam, curve_points=9, rings=3)
    elevation, azimuth = default_view(foam, patches)
    held = np.delete(foam.bubble_centres, foam.exterior, axis=0)
    towards = View.from_angles(elevation, azimuth).project(foam.cell.surface.normals(held))[:, 2]
    assert towards.min() > 0.7


def test_t1s_are_counted_by_the_step_that_made_them() -> None:
    one = quench()
    made = np.array([event.iteration for event in one.events])
    expected = [(made < k).sum() for k in one.history.iteration]
    np.testing.assert_array_equal(one.history.n_t1, expected)


def test_the_first_state_is_the_start() -> None:
    start = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=80, seed=3)
    history = quench().history
    assert history.energy[0] == pytest.approx(start.energy, rel=1e-13)
    worst = np.abs(start.bubble_volumes / start.target_volumes - 1.0).max()
    assert history.volume_error[0] == pytest.approx(worst, rel=1e-9)
    assert history.n_t1[0] == 0


def test_a_history_cut_short_is_the_beginning_of_the_whole() -> None:
    start = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=80, seed=3)
    short, whole = relax(start, max_iterations=4).history, quench().history
    for name in ("energy", "residual", "volume_error", "n_t1"):
        np.testing.assert_array_equal(getattr(short, name), getattr(whole, name)[:5])


def test_tension_scales_the_energy_only() -> None:
    start = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=30, seed=1)
    stiff = replace(start, tension=2.5)
    one, other = relax(start).history, relax(stiff).history
    np.testing.assert_allclose(other.energy, 2.5 * one.energy, rtol=1e-12)
    np.testing.assert_allclose(other.residual[:4], one.residual[:4], rtol=1e-6)


def test_the_picture_of_a_relaxation() -> None:
    one = quench()
    left, middle, right = plot_relaxation(one).axes
    np.testing.assert_array_equal(left.lines[0].get_ydata(), one.history.energy)
    np.testing.assert_array_equal(middle.lines[0].get_ydata(), one.history.residual)
    np.testing.assert_array_equal(right.lines[0].get_ydata(), one.history.n_t1)
    assert middle.get_yscale() == "log"
    assert f"{one.n_t1} T1s" in right.get_title()
    stopped = relax(torus_foam(), max_iterations=1)
    assert "NOT CONVERGED" in plot_relaxation(stopped).axes[1].get_title()


# ------------------------------------------------------------------ annealing, potentials


def test_the_picture_of_an_annealing() -> None:
    foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=12, seed=1)
    found = anneal(foam, steps=4, seed=4)
    left, right = plot_annealing(found).axes
    lines = {line.get_label(): line for line in left.lines}
    np.testing.assert_allclose(lines["best"].get_ydata(), found.history.best / found.start_energy)
    assert len(lines["taken"].get_ydata()) == found.n_accepted
    np.testing.assert_allclose(right.lines[0].get_ydata(), found.history.temperature)
    plot_annealing(anneal(foam, steps=1, temperature=0.0))
    with pytest.raises(ValueError, match="made no steps"):
        plot_annealing(anneal(foam, steps=0))


def test_the_force_along_a_path_is_the_slope_of_the_energy() -> None:
    found = path_potential("theory")
    left, right = plot_potential_path(found).axes
    np.testing.assert_allclose(left.lines[0].get_ydata(), found.ratios)
    force = right.lines[-1].get_ydata()
    slope = -np.gradient(found.energies, found.lengths)
    np.testing.assert_allclose(force[1:-1], slope[1:-1], atol=0.01 * np.abs(slope).max())
    assert left.get_yaxis().get_major_formatter().get_useOffset() is False


# ------------------------------------------------------------------ histograms


@pytest.mark.parametrize(
    "name",
    ["sides", "charge", "area", "volume", "pressure", "curvature", "film_length", "film_area", "angle"],
)
def test_bars_count_everything(name: str) -> None:
    foam = quench().foam
    axes = plot_histogram(foam, name).axes[0]
    counts = sum(bar.get_height() for bar in axes.patches)
    expected = {"film_length": 234, "film_area": 234, "angle": 3 * 156}.get(name, 80)
    assert counts == expected
    assert axes.get_title().startswith(f"{expected} ")


def test_mean_and_deviation() -> None:
    foam = quench().foam
    title = plot_histogram(foam, "film_length").axes[0].get_title()
    assert f"mean {foam.film_lengths.mean():.4g}" in title
    assert f"s.d. {foam.film_lengths.std():.3g}" in title
    angles = np.degrees(equilibrium_report(foam).vertex_angles)
    assert f"mean {angles.mean():.4g}" in plot_histogram(foam, "angle").axes[0].get_title()
    assert "mean 0," in plot_histogram(foam, "pressure").axes[0].get_title()


def test_what_is_left_out() -> None:
    foam = bubble_on_torus()
    assert plot_histogram(foam, "area").axes[0].get_title().startswith("1 bubbles")
    axes = plot_histogram([1.0, np.nan, 2.5, np.inf], label="speed (mm/s)").axes[0]
    assert axes.get_title().startswith("2 values, 2 blank")
    assert axes.get_xlabel() == "speed (mm/s)"
    assert sum(bar.get_height() for bar in plot_histogram(np.full(7, 3.25)).axes[0].patches) == 7
    assert len(plot_histogram(np.linspace(0.0, 1.0, 500), bins=7).axes[0].patches) == 7
    far = np.append(np.random.default_rng(0).normal(size=2000), 1e6)
    assert len(plot_histogram(far).axes[0].patches) <= 60


def test_columns_of_an_ensemble(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(
        'repeats = 3\nobservables = ["mu2"]\n[surface]\nkind = "sphere"\nradius = 1.0\n[cell]\ngap = 0.01\n'
        "[foam]\nn_bubbles = 14\n"
    )
    found = run_ensemble(read_study(tmp_path / "study.toml"), tmp_path / "out", workers=0)
    axes = plot_histogram(found, "mu2", where={"status": "converged"}).axes[0]
    assert sum(bar.get_height() for bar in axes.patches) == 3
    assert axes.get_xlabel() == "mu2"
    with pytest.raises(TypeError, match="must hold numbers"):
        plot_histogram(found, "status")
    with pytest.raises(TypeError, match="name of a column"):
        plot_histogram(found)


# ------------------------------------------------------------------ all of them


def pictures(width: float | None):
    """Every plot of a foam and of numbers, with its width."""
    foam = with_pressures(torus_foam())
    yield plot_foam(foam, "pressure", width=width)
    yield plot_foam(sphere_foam(60), width=width)
    yield plot_defects(sphere_foam(60), width=width)
    yield plot_order(foam, width=width)
    yield plot_map(foam, width=width)
    yield plot_sides(foam_statistics(sphere_foam(60)), width=width)
    yield plot_relaxation(quench(), width=width)
    yield plot_histogram(quench().foam, "angle", width=width)
    yield plot_potential_path([path_potential("theory")] * 2, width=width)
    yield plot_potential(path_potential("theory"), width=width)


@pytest.mark.parametrize("width", [86.0, 180.0])
def test_letters_can_be_read_at_the_width_of_a_column(width: float) -> None:
    for figure in pictures(width):
        figure.draw_without_rendering()
        wide, tall = figure.get_size_inches()
        assert wide == pytest.approx(width / 25.4)
        texts = [t for t in figure.findobj(match=lambda a: hasattr(a, "get_fontsize")) if t.get_text()]
        assert min(t.get_fontsize() for t in texts if t.get_visible()) >= 6.0
        box = figure.get_tightbbox()
        assert (min(box.x0, box.y0), max(box.x1 - wide, box.y1 - tall)) == pytest.approx((0.0, 0.0), abs=0.5)
        assert min(box.x0, box.y0) > -0.03
        assert max(box.x1 - wide, box.y1 - tall) < 0.03


def test_style_keeps_letters_readable_at_every_width() -> None:
    for mm in (40.0, 60.0, 86.0, 120.0, 180.0, 400.0, 1000.0):
        style = Style.of(mm)
        assert 6.0 <= style.small <= style.text <= style.title
        assert style.text <= 11.0


def test_text_stays_text_in_vector_files(tmp_path: Path) -> None:
    figure = plot_map(torus_foam(), title="findable words")
    svg = save_figure(tmp_path / "a.svg", figure).read_text()
    assert "findable words" in svg
    assert "<image" not in svg
    assert len(re.findall(r"<path", svg)) > 96
    pdf = save_figure(tmp_path / "a.pdf", figure).read_bytes()
    assert b"/Subtype /Image" not in pdf
    assert b"/FontFile2" in pdf  # TrueType, as editors want it
    assert save_figure(tmp_path / "b.svg", figure).read_text() == svg


def test_refusals() -> None:
    foam = sphere_foam(12)
    for call, fault, words in (
        (lambda: plot_relaxation(foam), TypeError, "relaxed must be a Relaxation"),
        (lambda: plot_relaxation(quench(), width=5.0), ValueError, "width"),
        (lambda: plot_annealing(foam), TypeError, "annealing"),
        (lambda: plot_potential_path(foam), TypeError, "potentials"),
        (lambda: plot_potential_path([]), ValueError, "1 to 5"),
        (lambda: plot_potential_path([foam]), TypeError, "potentials"),
        (lambda: plot_histogram(foam), ValueError, "quantity must be one of 'sides'"),
        (lambda: plot_histogram(foam, "mood"), ValueError, "quantity must be one of"),
        (lambda: plot_histogram(foam, "pressure"), ValueError, "relax the foam first"),
        (lambda: plot_histogram(foam, "area", bins=0), ValueError, "bins"),
        (lambda: plot_histogram(foam, "area", where={"a": 1}), ValueError, "where is for ensembles"),
        (lambda: plot_histogram([1.0], "area"), ValueError, "an array has none"),
        (lambda: plot_histogram(["a"]), TypeError, "must hold numbers"),
        (lambda: plot_histogram([np.nan]), ValueError, "no number to show"),
        (lambda: plot_histogram([1.0], label=3), TypeError, "label"),
    ):
        with pytest.raises(fault, match=words):
            call()
    surface = geometric_potential(HeleShawCell(Torus(20.0, 4.0), gap=0.5), 0.5, method="theory", nodes=60)
    with pytest.raises(ValueError, match="must be along a path"):
        plot_potential_path(surface)


def test_wide_pictures_are_as_before() -> None:
    """Without a width, figures have the size that they are told or always had."""
    assert plot_foam(sphere_foam(12), size=(5.0, 4.0)).get_size_inches().tolist() == [5.0, 4.0]
    assert plot_sides(foam_statistics(sphere_foam(60))).get_size_inches()[0] == pytest.approx(
        3 * 117.0 / 25.4
    )
    assert callable(plot_correlations)
    assert callable(plot_charge_profile)
    assert callable(plot_charge_energies)
