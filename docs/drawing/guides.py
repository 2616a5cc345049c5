"""Pictures of the guides (docs/*.png), each as the text beside it says."""

from __future__ import annotations

import csv
import runpy
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from concepts import relaxed

import warpedfoam as wf
from warpedfoam.plot import figure_circles

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"


def on_mesh(name: str, path: Path) -> None:
    """300 bubbles on a mesh of ours."""
    surface = wf.MeshSurface.from_file(DATA / f"{name}.ply")
    foam = relaxed(wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.3), 300, seed=0))
    wf.save_picture(path, foam, dpi=110)


def main_job(path: Path) -> None:
    """What ``run.py foam`` draws."""
    cell = wf.HeleShawCell(wf.Torus(20.0, 4.0), gap=0.5)
    wf.save_picture(path, relaxed(wf.voronoi_foam(cell, 200, seed=0)))


def schwarz_p(path: Path) -> None:
    """A unit of a periodic surface."""
    cell = wf.HeleShawCell(wf.SchwarzP(20.0), gap=0.5)
    wf.save_picture(path, relaxed(wf.voronoi_foam(cell, 200, seed=0)), view=(25.0, -60.0), dpi=110)


def clusters(path: Path) -> None:
    """Two open clusters on a thick torus, as `relax` leaves them."""
    torus = wf.Torus(8.0, 4.0)
    start = torus.points(np.array([1.2, 1.0]), np.array([-0.6, -1.9]))
    cell = wf.HeleShawCell(torus, gap=0.5)
    foam = wf.cluster_foam(cell, [19, 7], volumes=0.5, centre=start)
    wf.save_picture(path, relaxed(foam), view=(18.0, -75.0), dpi=110)


def defects_sphere(path: Path) -> None:
    """Clusters, outlined, and Burgers vectors."""
    cell = wf.HeleShawCell(wf.Sphere(10.0), gap=0.1)
    foam = relaxed(wf.voronoi_foam(cell, 500, seeds="lattice"))
    wf.save_figure(path, wf.plot_defects(foam), dpi=110)


def circles(path: Path) -> None:
    """Circles of radius 3 on the paper's torus."""
    figure_circles().save(path, dpi=100)


def of_the_paper(name: str) -> Callable[[Path], None]:
    """A picture of ``warpedfoam figures paper``; films of the torus from their table."""

    def drawn(path: Path) -> None:
        from warpedfoam.cli.figures import draw_paper

        with tempfile.TemporaryDirectory() as folder:
            draw_paper(folder, only=[name], torus_table=str(DATA / "torus_potential.csv"))
            path.write_bytes((Path(folder) / f"{name}.png").read_bytes())

    return drawn


def scars(path: Path) -> None:
    """From the table of the long runs: examples/06_scars_on_spheres.py."""
    drawn = runpy.run_path(str(ROOT / "examples" / "06_scars_on_spheres.py"))["drawn"]
    with (DATA / "scars.csv").open(newline="", encoding="utf-8") as stream:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]
    wf.save_figure(path, drawn(rows))


def coarsening(path: Path) -> None:
    """200 unequal bubbles on a sphere coarsen to 40."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)
    run = wf.coarsen(relaxed(wf.voronoi_foam(cell, 200, seed=0, volumes=0.4)), until=40)
    wf.save_figure(path, wf.plot_coarsening(run), dpi=110)


def drift(path: Path) -> None:
    """Bubbles that drift to the outer equator: examples/09_three_bubbles_drifting.py."""
    with tempfile.TemporaryDirectory() as folder:
        runpy.run_path(str(ROOT / "examples" / "09_three_bubbles_drifting.py"))["main"](folder)
        path.write_bytes((Path(folder) / "three_bubbles.png").read_bytes())


def viewer(path: Path) -> None:
    """A photograph of the page in a real browser, one bubble picked."""
    sys.path.insert(0, str(ROOT))
    from tests.browser import Browser, browser_path

    if browser_path() is None:
        print(f"# {path.name} stays as it is: no Chromium here")
        return
    cell = wf.HeleShawCell(wf.Torus(8.0, 4.0), gap=0.5)
    foam = relaxed(wf.voronoi_foam(cell, 200, seed=0))
    front = int(np.argmax(foam.bubble_centres @ np.array([0.35, -0.6, 0.72])))
    with tempfile.TemporaryDirectory() as folder:
        browser = Browser()
        try:
            browser.window(1100, 680)
            browser.open(wf.write_view(Path(folder) / "view.html", foam))
            browser.ask(f"foamViewer.ready.then(() => foamViewer.pick({int(foam.bubble_ids[front])}))")
            browser.settle()
            browser.screenshot(path)
        finally:
            browser.close()


PICTURES: dict[str, Callable[[Path], None]] = {
    "foam_torus": main_job,
    "foam_double_torus": lambda path: on_mesh("double_torus", path),
    "foam_junction": lambda path: on_mesh("junction", path),
    "foam_schwarz_p": schwarz_p,
    "clusters": clusters,
    "defects_sphere": defects_sphere,
    "geodesic_circles": circles,
    "second_order": of_the_paper("second_order"),
    "cylinder": of_the_paper("cylinder"),
    "torus_energy": of_the_paper("torus"),
    "scars": scars,
    "drift": drift,
    "coarsening": coarsening,
    "viewer": viewer,
}
