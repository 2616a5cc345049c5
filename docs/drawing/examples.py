"""Pictures and output of the gallery: every example is run as its page says, in a folder of its own."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import nbclient
import nbformat
import numpy as np
from concepts import relaxed
from matplotlib.figure import Figure

import warpedfoam as wf

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"


@contextlib.contextmanager
def elsewhere() -> Iterator[Path]:
    """A temporary folder to work in, with the folder "out" in it."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            Path("out").mkdir()
            yield Path("out")
        finally:
            os.chdir(before)


def module(name: str) -> Any:
    """An example as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def run_script(name: str, arguments: tuple[Any, ...], picture: str | Callable[[Path, Path], None]) -> None:
    """Keep what an example prints and its picture."""
    target = ROOT / "docs" / "pictures" / f"example_{name}.png"
    with elsewhere() as out:
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            module(name).main(*arguments)
        if isinstance(picture, str):
            target.write_bytes(min(out.glob(picture)).read_bytes())
        else:
            picture(out, target)
    target.with_suffix(".txt").write_text(said.getvalue(), encoding="utf-8")


def even_sphere(_out: Path, target: Path) -> None:
    """The first of the random foams, with its clusters."""
    cell = wf.HeleShawCell(wf.Sphere(radius=10.0), gap=0.5)
    wf.save_figure(target, wf.plot_defects(relaxed(wf.voronoi_foam(cell, 100, seed=0))), dpi=110)


def by_pressure(out: Path, target: Path) -> None:
    """The foam that was written, read back."""
    wf.save_picture(target, wf.load(out / "foam.npz"), color_by="pressure", dpi=110)


def shifted_tube(_out: Path, target: Path) -> None:
    """A section through the cell of example 08, its outer tube shifted far too much."""
    found = module("08_gap_against_curvature")
    radius, gap, shift = 4.0, float(found.GAP), 0.35
    figure = Figure(figsize=(6.0, 4.6), layout="constrained")
    axes = figure.add_subplot()
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    axes.plot(radius * np.cos(angle), radius * np.sin(angle), color="0.45", lw=3.0)
    outer = radius + gap
    axes.plot(shift + outer * np.cos(angle), outer * np.sin(angle), color="#2f78bd", lw=3.0)
    axes.plot(outer * np.cos(angle), outer * np.sin(angle), ":", color="0.5", lw=1.2)
    rim = np.array([-0.09, 0.09])
    inner, lid = 0.5 * np.pi + rim, 0.5 * np.pi + rim[::-1]
    x = np.r_[radius * np.cos(inner), outer * np.cos(lid)]
    y = np.r_[radius * np.sin(inner), outer * np.sin(lid)]
    axes.fill(x, y, color="#cc3d28", alpha=0.8)
    axes.text(0.0, outer + 0.25, "the bubble, held on top", ha="center", fontsize=10)
    axes.text(0.0, 0.0, "tube of the torus,\naxis far to the left", ha="center", va="center", fontsize=10)
    axes.annotate("wider gap", (outer + 0.15, 0.0), (outer + 0.9, 0.0), va="center", fontsize=10)
    axes.annotate("narrower", (-outer - 0.1, 0.0), (-outer - 1.9, 0.0), va="center", fontsize=10)
    axes.set(aspect="equal", xlim=(-6.6, 7.2), ylim=(-4.9, 5.3))
    axes.set_title("outer plate (blue) shifted outward by a: here hundreds of times too far", fontsize=10)
    axes.set_axis_off()
    wf.save_figure(target, figure, dpi=120)


#: Arguments as on the page, and the picture: a file that the example writes, or a function.
SCRIPTS: dict[str, tuple[tuple[Any, ...], str | Callable[[Path, Path], None]]] = {
    "01_first_foam_torus": (("out",), "torus.png"),
    "02_defects_on_a_sphere": ((), even_sphere),
    "03_export_ply": (("out",), by_pressure),
    "04_defects_on_tori": ((), "charge_3.png"),
    "05_polydispersity_ensemble": ((8, 150, "out", 0), "polydispersity.png"),
    "06_scars_on_spheres": ((1, 400), "scars.png"),
    "07_bubble_on_a_torus": ((), "torus_energy.png"),
    "08_gap_against_curvature": ((), shifted_tube),
    "09_three_bubbles_drifting": (("out",), "three_bubbles.png"),
    "10_coarsening_on_a_sphere": ((60, 30, "out"), "coarsening.png"),
}
#: What a new example gets until it stands above: ``main("out")`` and the first picture that it writes.
PLAIN: tuple[tuple[Any, ...], str | Callable[[Path, Path], None]] = (("out",), "*.png")


def study(name: str, overrides: list[str]) -> None:
    """One foam of a study."""
    chosen = wf.read_study(EXAMPLES / f"{name}.toml", ["repeats=1", *overrides])
    with tempfile.TemporaryDirectory() as folder:
        done = wf.run_ensemble(chosen, folder, workers=0)
        *_, foam = done.foams({"status": "converged"})
        wf.save_picture(ROOT / "docs" / "pictures" / f"example_{name}.png", foam, dpi=110)


def main_job() -> None:
    """The foam of foam.toml."""
    from warpedfoam.cli.app import app

    target = ROOT / "docs" / "pictures" / "example_foam.png"
    with elsewhere() as out:
        app(["run", str(EXAMPLES / "foam.toml"), "-o", str(out), "--quiet"], standalone_mode=False)
        target.write_bytes((out / "foam.png").read_bytes())


#: Options that keep the pictures of studies small.
STUDIES = {"polydispersity": ["foam.n_bubbles=100"], "schwarz_p": [], "tori": []}


def notebook(name: str) -> None:
    """Run a notebook and keep its pictures, numbered by cell; the notebook itself stays without output."""
    import base64

    sheet = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    with elsewhere() as out:
        nbclient.NotebookClient(sheet, timeout=120, resources={"metadata": {"path": str(out)}}).execute()
    for k, cell in enumerate(sheet.cells):
        for part in cell.get("outputs", []):
            if "image/png" in part.get("data", {}):
                path = ROOT / "docs" / "pictures" / f"example_{name}_{k}.png"
                path.write_bytes(base64.b64decode(part["data"]["image/png"]))


PICTURES: dict[str, Callable[[], None]] = {
    **{
        path.stem: (lambda n=path.stem: run_script(n, *SCRIPTS.get(n, PLAIN)))
        for path in sorted(EXAMPLES.glob("*.py"))
    },
    **{name: (lambda n=name, o=options: study(n, o)) for name, options in STUDIES.items()},
    "foam": main_job,
    "main_job": lambda: notebook("main_job"),
}
