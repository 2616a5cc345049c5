"""A foam in pyvista: its meshes hold the foam; it is drawn where drawing works."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from warpedfoam.io.colours import bubble_colours
from warpedfoam.plot import plot_foam_3d
from warpedfoam.plot.foam_3d import bubble_mesh, film_mesh

from .io_foams import bubble_on_torus, sphere_foam, torus_foam, with_pressures

pv = pytest.importorskip("pyvista")


@pytest.mark.parametrize("color_by", ["charge", "sides", "pressure", "curvature"])
def test_the_meshes_are_the_foam(color_by: str) -> None:
    foam = with_pressures(torus_foam())
    bubbles = bubble_mesh(foam, bubble_colours(foam, color_by))
    assert bubbles.area == pytest.approx(foam.cell.surface.area, rel=0.01)
    ids = bubbles.cell_data["bubble"]
    place = np.searchsorted(foam.bubble_ids, ids)
    np.testing.assert_array_equal(bubbles.cell_data["rgb"], bubble_colours(foam, color_by).rgb[place])
    np.testing.assert_array_equal(bubbles.cell_data["pressure"], foam.pressures[place])
    sizes = bubbles.compute_cell_sizes(length=False, volume=False).cell_data["Area"]
    np.testing.assert_allclose(np.bincount(place, sizes), foam.bubble_areas, rtol=0.03)
    length = film_mesh(foam).area / (2.0 * np.pi * 0.025 * foam.bubble_size)
    assert length == pytest.approx(foam.film_lengths.sum(), rel=0.1)
    for films in (True, False):
        plotter = plot_foam_3d(foam, color_by, films=films, off_screen=True)
        assert {"bubbles", "films"} & set(plotter.actors) == ({"bubbles", "films"} if films else {"bubbles"})
        plotter.close()


def test_refusals() -> None:
    foam = sphere_foam(12)
    for keywords, fault, words in (
        ({"color_by": "mood"}, ValueError, "color_by must be one of"),
        ({"films": 1}, TypeError, "films"),
        ({"size": 300}, TypeError, "pair of numbers of pixels"),
        ({"size": (3, 300)}, ValueError, "size must be at least 50"),
    ):
        with pytest.raises(fault, match=words):
            plot_foam_3d(foam, off_screen=True, **keywords)
    with pytest.raises(TypeError, match="must be a Foam"):
        plot_foam_3d("foam")
    plot_foam_3d(bubble_on_torus(), off_screen=True).close()


def test_it_is_drawn(tmp_path: Path) -> None:
    """In a process of its own: where there is no way to draw, VTK may end it."""
    picture = tmp_path / "foam.png"
    code = (
        f"import sys; sys.path[:0] = {[str(Path(__file__).parent), *sys.path]!r}\n"
        "import warnings; warnings.simplefilter('ignore')\n"
        "from io_foams import sphere_foam\nfrom warpedfoam.plot import plot_foam_3d\n"
        f"plot_foam_3d(sphere_foam(60), off_screen=True, size=(300, 240)).screenshot({str(picture)!r})\n"
    )
    try:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=120, check=False)
    except subprocess.TimeoutExpired:
        pytest.skip("drawing takes too long here")
    if done.returncode or not picture.exists():
        pytest.skip("nothing can be drawn here")
    from matplotlib.image import imread

    image = imread(picture)[:, :, :3]
    assert image.shape == (240, 300, 3)
    assert (image[:8, :8] == 1.0).all()
    middle = image[60:180, 90:210].reshape(-1, 3)
    dark = (middle.max(axis=1) < 0.3).mean()
    red = ((middle[:, 0] - middle[:, 2]) > 0.2).mean()
    blue = ((middle[:, 2] - middle[:, 0]) > 0.1).mean()
    assert 0.01 < dark < 0.5
    assert red > 0.05
    assert blue > 0.02
