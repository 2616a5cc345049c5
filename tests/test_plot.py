"""Pictures: what is seen must be what a ray from the viewer would meet."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from warpedfoam import Foam
from warpedfoam.io.colours import bubble_colours
from warpedfoam.io.patches import bubble_patches
from warpedfoam.plot import plot_foam, save_picture
from warpedfoam.plot.projection import View

from .io_foams import bubble_on_torus, lone_bubble, sphere_foam, torus_foam, with_pressures


def _seen(foam: Foam, view: View, spots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bubble (or −1) that a ray meets first at each spot (n, 2), where, and how squarely."""
    patches = bubble_patches(foam, curve_points=11, rings=5)
    corners = view.project(patches.points)[patches.triangles]
    bubble, depth = np.full(len(spots), -1), np.full(len(spots), -np.inf)
    square = np.zeros(len(spots))
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    slope = np.abs(det) / np.linalg.norm(np.cross(ab, ac), axis=1)
    det = np.where(det == 0.0, np.nan, det)
    for i, spot in enumerate(spots):
        d = spot - a[:, :2]
        u = (d[:, 0] * ac[:, 1] - d[:, 1] * ac[:, 0]) / det
        v = (ab[:, 0] * d[:, 1] - ab[:, 1] * d[:, 0]) / det
        hit = np.flatnonzero((u >= 0) & (v >= 0) & (u + v <= 1))
        if hit.size:
            deep = a[hit, 2] + u[hit] * ab[hit, 2] + v[hit] * ac[hit, 2]
            k = hit[np.argmax(deep)]
            bubble[i], depth[i], square[i] = patches.triangle_bubble[k], deep.max(), slope[k]
    return bubble, np.column_stack([spots, depth]), square


@pytest.mark.parametrize(
    ("foam", "angles"),
    [
        (with_pressures(sphere_foam(80)), (25.0, -60.0)),
        (with_pressures(torus_foam()), (12.0, 20.0)),
        (with_pressures(torus_foam()), (48.0, -60.0)),
        (with_pressures(torus_foam(6, 24, major_radius=12.0, minor_radius=4.0)), (5.0, 0.0)),
    ],
    ids=["sphere", "torus-side", "torus-above", "thin-torus"],
)
def test_every_pixel_shows_the_bubble_nearest_to_the_viewer(foam: Foam, angles: tuple[float, float]) -> None:
    figure = plot_foam(foam, "pressure", view=angles)
    figure.set_dpi(120)
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[:, :, :3].astype(float)
    axes = figure.axes[0]
    view = View.from_angles(*angles)
    rng = np.random.default_rng(1)
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    spots = np.column_stack([rng.uniform(x0, x1, 300), rng.uniform(y0, y1, 300)])
    bubble, where, square = _seen(foam, view, spots)
    films = view.project(foam.film_curves(30)).reshape(-1, 3)
    from_film = np.array([np.linalg.norm(films - w, axis=1).min() for w in where])
    # clear spots: bubbles seen squarely and away from their own films; nothing else may show there
    clear = (bubble >= 0) & (square > 0.35) & (from_film > 0.2 * foam.bubble_size)
    assert clear.sum() > 30
    pixel = np.round(axes.transData.transform(spots)).astype(int)
    shown = image[np.clip(len(image) - 1 - pixel[:, 1], 0, len(image) - 1), pixel[:, 0]]
    expected = bubble_colours(foam, "pressure").rgb[bubble].astype(float)
    shade = shown.sum(axis=1) / expected.sum(axis=1)
    agrees = np.abs(shown - shade[:, None] * expected).max(axis=1) < 8.0
    agrees &= (shade > 0.65) & (shade < 1.05)
    assert agrees[clear].mean() > 0.985
    solid = view.project(bubble_patches(foam, curve_points=11, rings=5).points)[:, :2]
    beside = np.array([np.linalg.norm(solid - spot, axis=1).min() for spot in spots])
    empty = (bubble < 0) & (beside > 0.1 * foam.bubble_size)
    assert empty.sum() > 30
    assert (shown[empty] == 255.0).all()


def test_films_are_drawn_where_they_are() -> None:
    foam = sphere_foam(60)
    figure = plot_foam(foam, view=(0.0, 0.0))
    figure.set_dpi(120)
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[:, :, :3].astype(int)
    curves = foam.film_curves(9)[:, 1:-1].reshape(-1, 3)
    front = curves[curves[:, 0] > 0.5]  # looking along −x, y to the right and z up
    pixel = np.round(figure.axes[0].transData.transform(front[:, 1:])).astype(int)
    dark = [
        image[len(image) - 1 - y - 1 : len(image) - y + 1, x - 1 : x + 2].sum(axis=2).min() for x, y in pixel
    ]
    assert (np.array(dark) < 250).mean() > 0.98


def test_what_faces_away_is_not_drawn() -> None:
    foam = sphere_foam(60)
    drawn = plot_foam(foam).axes[0].collections[0].get_paths()
    n_triangles = len(bubble_patches(foam, curve_points=11, rings=5).triangles)
    assert 0.4 < len(drawn) / (n_triangles + 10 * foam.network.n_films) < 0.6


def test_legend_counts_all_bubbles() -> None:
    foam = sphere_foam(60)
    texts = [t.get_text() for t in plot_foam(foam).legends[0].get_texts()]
    assert sum(int(t.rsplit(":", 1)[1]) for t in texts) == 60
    for n, name in ((5, "n = 5  (q = +1)"), (6, "n = 6  (q = 0)"), (7, "n = 7  (q = −1)")):
        assert f"{name}:  {int((foam.network.sides == n).sum())}" in texts
    texts = [t.get_text() for t in plot_foam(foam, "sides").legends[0].get_texts()]
    assert f"n = 6:  {int((foam.network.sides == 6).sum())}" in texts
    assert [t.get_text() for t in plot_foam(bubble_on_torus()).legends[0].get_texts()][-1] == "exterior:  1"


@pytest.mark.parametrize("name", ["charge", "area"])
def test_nothing_is_cut_off(name: str) -> None:
    figure = plot_foam(sphere_foam(60), name)
    figure.canvas.draw()
    parts = [*figure.legends, *(axes.get_tightbbox() for axes in figure.axes)]
    boxes = [part.get_window_extent() if hasattr(part, "get_window_extent") else part for part in parts]
    width, height = figure.canvas.get_width_height()
    assert len(boxes) == 2
    for box in boxes:
        assert 0 <= box.x0 < box.x1 <= width
        assert 0 <= box.y0 < box.y1 <= height
    assert not boxes[0].overlaps(boxes[1])


def test_title_and_colour_bar() -> None:
    foam = with_pressures(torus_foam())
    figure = plot_foam(foam, "area")
    assert figure.axes[0].get_title() == f"96 bubbles on a torus · energy {foam.energy:.6g}"
    assert figure.axes[1].get_ylabel() == "area of the bubble (length²)"
    low, high = figure.axes[1].get_ylim()
    assert (low, high) == pytest.approx((foam.bubble_areas.min(), foam.bubble_areas.max()))
    assert plot_foam(bubble_on_torus()).axes[0].get_title().startswith("1 bubble on a torus")
    assert plot_foam(foam, title="mine").axes[0].get_title() == "mine"


@pytest.mark.parametrize(("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_files_are_reproducible(tmp_path: Path, suffix: str, magic: bytes) -> None:
    foam = lone_bubble()
    first = save_picture(tmp_path / f"a.{suffix}", foam, dpi=60).read_bytes()
    assert first.startswith(magic)
    assert save_picture(tmp_path / f"b.{suffix}", foam, dpi=60).read_bytes() == first
    assert len(list(tmp_path.iterdir())) == 2


def test_refusals(tmp_path: Path) -> None:
    foam = sphere_foam(12)
    for keywords, fault, words in (
        ({"color_by": "pressure"}, ValueError, "relax the foam first"),
        ({"color_by": 3}, TypeError, "color_by"),
        ({"view": 30.0}, TypeError, "pair of numbers"),
        ({"view": (30.0, np.nan)}, ValueError, "finite"),
        ({"size": (0.1, 5.0)}, ValueError, "at least 1 inch"),
        ({"title": 3}, TypeError, "title"),
    ):
        with pytest.raises(fault, match=words):
            plot_foam(foam, **keywords)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="must be a Foam"):
        plot_foam("foam")  # type: ignore[arg-type]
    for path, dpi, words in (("a.jpg", 100, r"\.png or \.svg"), ("a.png", 5, "at least 20")):
        with pytest.raises(ValueError, match=words):
            save_picture(tmp_path / path, foam, dpi=dpi)


def test_importing_plot_does_not_import_matplotlib() -> None:
    code = "import sys, warpedfoam.plot; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_pyplot_is_left_alone() -> None:
    code = (
        f"import sys\nsys.path[:0] = {[str(Path(__file__).parent), *sys.path]!r}\n"
        "from io_foams import lone_bubble\nfrom warpedfoam.plot import plot_foam\n"
        "plot_foam(lone_bubble())\nsys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
