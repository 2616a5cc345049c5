"""Maps: every point of the surface lies on the map once, in its own bubble, and what is true is true."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from matplotlib.path import Path

from warpedfoam import (
    Catenoid,
    Cylinder,
    Ellipsoid,
    FlatTorus,
    Foam,
    Graph,
    HeleShawCell,
    Revolution,
    SchwarzP,
    Sphere,
    Torus,
    defects,
    plot_map,
    relax,
    voronoi_foam,
)
from warpedfoam.io.patches import bubble_patches
from warpedfoam.plot.map_picture import _pieces
from warpedfoam.plot.maps import chart_of, projections, regions, sheets, window_area
from warpedfoam.plot.maps.plate import Plate

from .io_foams import bubble_on_torus, lone_bubble, sphere_foam, torus_foam, with_pressures

K = 2.0 * np.pi / 8.0
HILLS = Graph(
    lambda x: 0.6 * np.cos(K * x).sum(axis=1), lambda x: -0.6 * K * np.sin(K * x), 8.0, 8.0, periodic=True
)
HILL = Graph(
    lambda x: np.exp(-0.5 * (x**2).sum(axis=1)),
    lambda x: -x * np.exp(-0.5 * (x**2).sum(axis=1))[:, None],
    5.0,
    5.0,
    disk=True,
)
EGG = Revolution(lambda z: 4.0 * (1.0 - z**2 / 9.0), lambda z: -8.0 * z / 9.0, -3.0, 3.0)
VASE = Revolution(lambda z: (2.0 + 0.3 * z) ** 2, lambda z: 0.6 * (2.0 + 0.3 * z), -3.0, 3.0)
SURFACES = {
    "torus": Torus(5.0, 2.0),
    "sphere": Sphere(2.0),
    "ellipsoid": Ellipsoid(2.0, 2.5, 3.0),
    "tube": Cylinder(1.5, 6.0, periodic=True),
    "open": Cylinder(1.5, 6.0),
    "catenoid": Catenoid(1.5, 3.5),
    "egg": EGG,
    "vase": VASE,
    "flat": FlatTorus(5.0, 4.0),
    "hills": HILLS,
    "hill": HILL,
}
CASES = [(name, way) for name, surface in SURFACES.items() for way in projections(surface)]


@cache
def foam_on(name: str) -> Foam:
    if name == "sphere":
        return sphere_foam(60, seed=3)
    return voronoi_foam(
        HeleShawCell(SURFACES[name], gap=0.05), n_bubbles=70, seed=4, seeds="blue", n_nodes=6000
    )


def mapped(foam: Foam, way: str | None, points: int = 9, centre: tuple[float, float] | None = None):
    chart = chart_of(foam.cell.surface, way, centre)
    return chart, regions(foam.network, chart.strands(foam.film_curves(points)), chart)


def inside(found, bubble: int, at: np.ndarray) -> np.ndarray:
    """Whether points lie in the outlines of a bubble, holes left out."""
    hits = np.zeros(len(at), dtype=int)
    for k in np.flatnonzero(found.bubble == bubble):
        hits += Path(found.outlines[k]).contains_points(at)
    return hits % 2 == 1


@pytest.mark.parametrize(("name", "way"), CASES)
def test_outlines_fill_the_map_once(name: str, way: str) -> None:
    foam = foam_on(name)
    chart, found = mapped(foam, way)
    areas = found.bubble_areas(foam.n_bubbles)
    assert areas.min() > 0.0
    # chords of the edge differ by where films cut it, on maps with a curved edge
    allowed = 1e-12 if chart.axes() is not None and not isinstance(chart, Plate) else 1e-6
    assert areas.sum() == pytest.approx(window_area(chart), rel=allowed)
    # no film leaves its window, not even for a step
    at = chart.strands(foam.film_curves(9)).at
    if way == "stereographic":
        assert np.linalg.norm(at, axis=1).max() < 1.0 + 1e-12
    elif isinstance(chart, Plate):
        assert np.linalg.norm(at, axis=1).max() < chart.radius + 1e-9
    else:
        assert (at > chart.low - 1e-9).all()
        assert (at < chart.high + 1e-9).all()


@pytest.mark.parametrize(("name", "way"), CASES)
def test_points_lie_in_their_own_bubble(name: str, way: str) -> None:
    foam = foam_on(name)
    chart, found = mapped(foam, way, points=17)
    patches = bubble_patches(foam, curve_points=9, rings=3)
    corners = patches.points[patches.triangles]
    # away from films, which the outlines follow by chords
    middle = foam.cell.surface.project(corners.mean(axis=1)[::37])
    owner = patches.triangle_bubble[::37]
    films = foam.film_curves(9).reshape(-1, 3)
    clear = np.array([np.linalg.norm(films - m, axis=1).min() for m in middle]) > 0.03
    at = chart.where(middle)
    for bubble in range(foam.n_bubbles):
        mine = clear & (owner == bubble)
        others = clear & (owner != bubble)
        assert inside(found, bubble, at[mine]).all()
        assert not inside(found, bubble, at[others]).any()


@pytest.mark.parametrize(("name", "way"), [c for c in CASES if chart_of(SURFACES[c[0]], c[1], None).scale])
def test_areas_on_equal_area_maps_are_the_bubbles(
    name: str, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To second order in the length of the chords that films are drawn with, and in their steps in angle."""
    foam = foam_on(name)
    scale = chart_of(foam.cell.surface, way, None).scale
    errors = []
    for points in (9, 17):
        monkeypatch.setattr(sheets, "STEP", np.radians(18.0 / (points - 1)))
        areas = mapped(foam, way, points)[1].bubble_areas(foam.n_bubbles)
        errors.append(np.abs(areas / (scale * foam.bubble_areas) - 1.0).mean())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 3.0
    monkeypatch.undo()
    areas = mapped(foam, way, 17)[1].bubble_areas(foam.n_bubbles)
    np.testing.assert_allclose(areas, scale * foam.bubble_areas, rtol=3e-3)


@pytest.mark.parametrize(("name", "way"), CASES)
def test_scales(name: str, way: str) -> None:
    """Singular values of the map's derivative: equal on conformal maps, of product 1 on equal-area ones."""
    surface = SURFACES[name]
    chart = chart_of(surface, way, None)
    x = surface.random_points(80, 5)
    h = 1e-5 * surface.size
    frames = surface.vertex_frames(x)
    ahead, behind = (
        np.stack([chart.where(surface.project(x + sign * h * frames[:, k])) for k in (0, 1)], axis=2)
        for sign in (1.0, -1.0)
    )
    slope = (ahead - behind) / (2.0 * h)
    values = np.linalg.svd(slope, compute_uv=False)
    smooth = values[:, 0] < 30.0  # not across a seam, nor next to a pole
    assert smooth.sum() > 60
    values, slope = values[smooth], slope[smooth]
    # seen from outside: not mirrored (frames may be, so compare their sense)
    sense = np.einsum("ni,ni->n", np.cross(frames[:, 0], frames[:, 1]), surface.normals(x))[smooth]
    assert (np.linalg.det(slope) * sense > 0.0).all()
    if chart.scale is not None:
        np.testing.assert_allclose(values.prod(axis=1), chart.scale, rtol=1e-3)
    if way in ("conformal",) or (way == "stereographic" and name == "sphere"):
        np.testing.assert_allclose(values[:, 0], values[:, 1], rtol=1e-3)
    if way == "angles":
        assert (np.abs(values - 1.0).min(axis=1) < 1e-3).all()
    if name in ("tube", "open", "flat"):
        np.testing.assert_allclose(values, 1.0, atol=2e-4)


@pytest.mark.parametrize(("name", "way"), CASES)
def test_no_line_runs_across_the_map(name: str, way: str) -> None:
    foam = foam_on(name)
    chart = chart_of(foam.cell.surface, way, None)
    pieces = _pieces(chart.strands(foam.film_curves(17)), chart)
    steps = np.concatenate([np.linalg.norm(np.diff(piece, axis=0), axis=1) for piece in pieces])
    width = np.ptp(chart.drawn(chart.edge()[0], np.zeros(len(chart.edge()[0]), dtype=int))[:, 0])
    assert steps.max() < 0.12 * width
    # every film is there: its middle lies on a line
    drawn = np.concatenate(pieces)
    at = chart.where(foam.film_curves(3)[:, 1])
    near = np.array([np.linalg.norm(drawn - p, axis=1).min() for p in at])
    assert near.max() < 0.06 * width


def tetrahedron(points: np.ndarray) -> Foam:
    loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    return Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)


CORNERS = np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])


@pytest.mark.parametrize("way", projections(Sphere(1.0)))
@pytest.mark.parametrize("case", ["film through the pole", "vertex at the pole", "edge on the seam"])
def test_films_and_vertices_on_poles_and_seams(way: str, case: str) -> None:
    points = CORNERS
    if case == "vertex at the pole":
        a = np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
        b = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
        points = CORNERS @ np.stack([b, np.cross(a, b), a], axis=1)
    elif case == "edge on the seam":
        # the film of the first two runs over the top along the meridian ±180° and 0°
        c = np.sqrt(0.5)
        points = CORNERS @ np.array([[c, c, 0.0], [-c, c, 0.0], [0.0, 0.0, 1.0]])
    foam = tetrahedron(points)
    chart, found = mapped(foam, way, 33)
    areas = found.bubble_areas(4)
    assert areas.sum() == pytest.approx(window_area(chart), rel=1e-5)
    assert areas.min() > 0.0
    if chart.scale:
        np.testing.assert_allclose(areas, np.pi, rtol=3e-3)


@pytest.mark.parametrize("centre", [(0.0, 90.0), (0.0, 0.0), (180.0, 180.0), (11.25, -60.0), (30.0, 7.5)])
def test_vertices_on_the_seams_of_a_torus(centre: tuple[float, float]) -> None:
    foam = torus_foam()
    for way in projections(foam.cell.surface):
        chart, found = mapped(foam, way, 9, centre)
        areas = found.bubble_areas(foam.n_bubbles)
        assert areas.sum() == pytest.approx(window_area(chart), rel=1e-12)
        assert areas.min() > 0.0


def test_another_middle_shows_the_same_foam() -> None:
    foam = foam_on("sphere")
    for centre in ((0.0, 0.0), (40.0, 0.0), (-130.0, 70.0), (10.0, -90.0)):
        areas = mapped(foam, "hammer", 33, centre)[1].bubble_areas(foam.n_bubbles)
        np.testing.assert_allclose(areas, foam.bubble_areas, rtol=5e-3)
    x = np.array([[np.cos(0.3) * np.cos(1.0), np.cos(0.3) * np.sin(1.0), np.sin(0.3)]])
    chart = chart_of(Sphere(1.0), "hammer", (np.degrees(1.0), np.degrees(0.3)))
    np.testing.assert_allclose(chart.where(x), 0.0, atol=1e-12)


@pytest.mark.parametrize("way", projections(Sphere(1.0)))
def test_a_bubble_and_the_rest_of_the_sphere(way: str) -> None:
    """A loop that touches no seam, and one half of the globe without any film."""
    foam = lone_bubble()
    chart, found = mapped(foam, way, 65)
    areas = found.bubble_areas(2)
    assert areas.sum() == pytest.approx(window_area(chart), rel=1e-6)
    assert areas[0] < 0.4 * areas[1]
    if chart.scale:
        np.testing.assert_allclose(areas, foam.bubble_areas, rtol=2e-3)


@pytest.mark.parametrize("way", projections(Torus(3.0, 1.2)))
def test_an_exterior_is_what_is_left(way: str) -> None:
    foam = bubble_on_torus()
    for centre in ((0.0, 90.0), (180.0, 0.0), (180.0, 180.0)):
        chart, found = mapped(foam, way, 33, centre)
        areas = found.bubble_areas(2)
        assert areas.sum() == pytest.approx(window_area(chart), rel=1e-12)
        assert 0.0 < areas[0] < 0.1 * areas[1]


def test_the_picture_has_the_films() -> None:
    foam = foam_on("torus")
    (films,) = [c for c in plot_map(foam).axes[0].collections if c.get_zorder() == 2.0]
    chart = chart_of(foam.cell.surface, None, None)
    expected = _pieces(chart.strands(foam.film_curves(17)), chart)
    assert len(films.get_segments()) == len(expected) > foam.network.n_films
    np.testing.assert_allclose(np.concatenate(films.get_segments()), np.concatenate(expected))


def test_what_the_picture_says() -> None:
    foam = with_pressures(torus_foam())
    figure = plot_map(
        foam, "equal_area", color_by="pressure", label="pressure (γ/ℓ)", width=86.0, title="mine"
    )
    assert figure.get_size_inches()[0] == pytest.approx(86.0 / 25.4)
    assert "areas true" in figure.axes[0].get_xlabel()
    assert figure.axes[0].get_title() == "mine"
    assert figure.axes[1].get_xlabel() == "pressure (γ/ℓ)"
    figure = plot_map(foam, color_by=np.arange(96.0), vertices=True)
    assert figure.axes[0].collections[-1].get_offsets().shape == (foam.network.n_vertices, 2)
    fills = figure.axes[0].collections[0]
    assert len(fills.get_paths()) == 96
    figure = plot_map(sphere_foam(60), defects=True)
    legends = [axes.get_legend() for axes in figure.axes[1:]]
    assert [legend.get_title().get_text() for legend in legends] == [
        "sides n, charge q = 6 − n:  bubbles",
        "clusters",
    ]
    assert sum(int(t.get_text().rsplit(":", 1)[1]) for t in legends[0].get_texts()) == 60
    outlined = [c for c in figure.axes[0].collections if c.get_zorder() == 3.5]
    assert outlined


def test_joined_sides_are_dashed_and_rims_heavy() -> None:
    def sides(name: str) -> list[tuple[bool, float]]:
        lines = plot_map(foam_on(name)).axes[0].lines
        return [(line.is_dashed(), line.get_linewidth()) for line in lines]

    assert [dashed for dashed, _ in sides("torus")] == [True] * 4
    assert [dashed for dashed, _ in sides("open")] == [False, True, False, True]
    assert sides("open")[0][1] > 2.0 * sides("open")[1][1]
    assert [dashed for dashed, _ in sides("tube")] == [True] * 4


@pytest.mark.parametrize("width", [60.0, 86.0, 180.0])
def test_letters_are_readable_and_nothing_is_cut_off(width: float) -> None:
    for foam, keywords in (
        (torus_foam(), {}),
        (sphere_foam(60), {"projection": "stereographic", "defects": True}),
        (foam_on("catenoid"), {"color_by": "curvature"}),
    ):
        figure = plot_map(foam, width=width, **keywords)
        figure.draw_without_rendering()
        texts = [t for t in figure.findobj(match=lambda a: hasattr(a, "get_fontsize")) if t.get_text()]
        assert min(t.get_fontsize() for t in texts) >= 6.0
        box = figure.get_tightbbox()
        wide, tall = figure.get_size_inches()
        assert wide == pytest.approx(width / 25.4)
        assert box.x0 > -0.02
        assert box.y0 > -0.02
        assert box.x1 < wide + 0.02
        assert box.y1 < tall + 0.02


def test_a_foam_of_two_thousand() -> None:
    foam = sphere_foam(2000, even=True)
    _, found = mapped(foam, "hammer", 6)
    np.testing.assert_allclose(found.bubble_areas(2000), foam.bubble_areas, rtol=0.05)


def test_refusals() -> None:
    foam = torus_foam()
    other = sphere_foam(20)
    for keywords, fault, words in (
        ({"projection": "hammer"}, ValueError, "'angles', 'equal_area', 'conformal'"),
        ({"projection": 3}, TypeError, "projection must be a string"),
        ({"color_by": np.zeros(3)}, ValueError, "96 numbers, one per bubble"),
        ({"color_by": np.full(96, np.nan)}, ValueError, "no value that is a number"),
        ({"color_by": "mood"}, ValueError, "color_by must be one of"),
        ({"color_by": "pressure"}, ValueError, "relax the foam first"),
        ({"label": 3}, TypeError, "label"),
        ({"title": 3}, TypeError, "title"),
        ({"width": 10.0}, ValueError, "width"),
        ({"width": "wide"}, TypeError, "width"),
        ({"centre": 3.0}, TypeError, "pair of angles"),
        ({"centre": (0.0, np.inf)}, ValueError, "centre"),
        ({"vertices": 1}, TypeError, "vertices"),
        ({"defects": "yes"}, TypeError, "defects"),
        ({"defects": defects(other)}, ValueError, "another foam"),
    ):
        with pytest.raises(fault, match=words):
            plot_map(foam, **keywords)
    with pytest.raises(TypeError, match="must be a Foam"):
        plot_map("foam")
    with pytest.raises(ValueError, match="stereographic map, which shows both"):
        plot_map(other, "stereographic", centre=(1.0, 2.0))
    with pytest.raises(ValueError, match=r"a SchwarzP cannot be unrolled .* plot_foam .* warpedfoam view"):
        chart_of(SchwarzP(8.0), None, None)
    with pytest.raises(ValueError, match="a plane map has none"):
        chart_of(FlatTorus(3.0, 2.0), None, (1.0, 2.0))
    with pytest.raises(ValueError, match="a plane map has none"):
        chart_of(HILL, None, (1.0, 2.0))


def test_films_that_do_not_bound_bubbles_are_refused() -> None:
    """A film of more than half a turn, drawn the short way round: such foams do not relax either."""
    foam = voronoi_foam(HeleShawCell(Torus(20.0, 4.0), gap=0.5), n_bubbles=60, seed=1)
    assert not relax(foam).converged
    with pytest.raises(ValueError, match="do not bound the bubbles"):
        plot_map(foam)
