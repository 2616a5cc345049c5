"""The documentation's site: it builds without a warning, holds every public name, every example, every page.

The gallery runs nothing: its pictures are in docs/pictures (``python3 run.py gallery``), its examples are
run and checked by test_examples.py, the notebook here.
"""

from __future__ import annotations

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path

import nbclient
import nbformat
import pytest

import warpedfoam as wf

ROOT = Path(__file__).parents[1]
DOCS, EXAMPLES = ROOT / "docs", ROOT / "examples"
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT / "src")}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy, as ``python3 run.py docs`` does; the only build in all tests."""
    folder = tmp_path_factory.mktemp("site")
    # a copy, so that pages written by hand meanwhile do not disturb; links lead out of docs/
    for name in ("docs", "examples", "benchmarks", "data"):
        shutil.copytree(
            ROOT / name, folder / name, ignore=shutil.ignore_patterns("_build", "gallery", "reference")
        )
    for name in ("README.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, folder / name)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "docs", "html"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, env=ENVIRONMENT)
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
    return folder / "html"


def text_of(page: Path) -> str:
    return unescape(page.read_text(encoding="utf-8"))


def test_formulas_have_indices(site: Path) -> None:
    theory = text_of(site / "theory.html")
    assert "κ<sub>s</sub> = H + D cos 2ψ" in theory
    assert '<p class="formula">' in theory
    # an underscore that begins an emphasis, as Markdown has it, would eat two indices
    for page in site.rglob("*.html"):
        if page.parent.name not in ("reference", "gallery"):
            body = re.sub(r"<(pre|code|title|script|style).*?</\1>", "", text_of(page), flags=re.DOTALL)
            left = re.findall(r"[>\s(]([∫Σκpqℓθ]_\w+)", re.sub(r"<[^>]*>", " ", body))
            assert not left, (page.name, left)


def test_the_site_has_every_public_name(site: Path) -> None:
    anchors = {
        a
        for page in site.glob("reference/*.html")
        for a in re.findall(r'id="(warpedfoam[\w.]*)"', text_of(page))
    }
    names = {f"warpedfoam.{name}" for name in wf.__all__ if name != "theory"}
    names |= {f"warpedfoam.theory.{name}" for name in wf.theory.__all__}
    assert names - anchors == set()
    # and leads to code that runs: in its docstring, on a page, in an example; a type, by what makes it
    kinds = {name: getattr(wf, name) for name in wf.__all__ if inspect.isroutine(getattr(wf, name))}
    kinds |= {name: getattr(wf, name) for name in wf.__all__ if inspect.isclass(getattr(wf, name))}
    head = r'<dt class="sig sig-object py" id="warpedfoam\.(\w+)">'
    shown = {
        name: text
        for page in site.glob("reference/*.html")
        for name, text, _ in re.findall(rf"{head}(.*?)(?={head}|\Z)", text_of(page), re.DOTALL)
    }
    bare = {
        name
        for name, kind in kinds.items()
        if not any(mark in shown[name] for mark in ('class="gp"', "Used in ", "Made by "))
        and not (inspect.isclass(kind) and issubclass(kind, Exception))
    }
    # plot_foam_3d opens a window; the others are what larger things hold, or what a surface must have
    assert bare <= {
        "plot_foam_3d", "AnnealingHistory", "CoarseningEvent", "DriftEvent", "PartitionTry",
        "RelaxationHistory", "T1Event", "GapField", "LevelSurface", "Surface", "LayeredRelaxation",
    }  # fmt: skip
    # and docstrings are rendered, not just named: a method, a parameter
    assert "warpedfoam.Foam.film_curves" in anchors
    assert "target_volumes" in text_of(site / "reference" / "foam.html")


def test_every_page_is_in_a_toctree(site: Path) -> None:
    """Sphinx warns, and warnings are errors; here the side bar of the front page is read."""
    front = text_of(site / "index.html")
    for page in [*DOCS.glob("*.md"), *DOCS.glob("*/*.md")]:
        name = page.relative_to(DOCS).with_suffix(".html").as_posix()
        if name not in {"index.html"} and not name.startswith(("gallery/", "reference/", "_build/")):
            assert f'href="{name}"' in front, name
            assert (site / name).exists()


def test_every_example_has_a_page_and_a_picture(site: Path) -> None:
    cards = text_of(site / "gallery" / "index.html")
    for example in EXAMPLES.iterdir():
        if example.suffix not in {".py", ".toml", ".ipynb"}:
            continue
        name = example.stem + ("_study" if example.suffix == ".toml" else "")
        assert f'href="{name}.html"' in cards
        page = text_of(site / "gallery" / f"{name}.html")
        assert example.name in page
        shown = re.findall(rf"_images/(example_{example.stem}\w*\.png)", page)
        assert shown, f"draw it with: python3 run.py gallery example_{example.stem}"
        assert all((site / "_images" / name).stat().st_size > 5_000 for name in shown)


def test_names_in_the_text_lead_to_the_reference(site: Path) -> None:
    page = text_of(site / "clusters.html")
    assert 'href="reference/clusters.html#warpedfoam.cluster_potential"' in page


def test_the_command_line_is_there(site: Path) -> None:
    page = text_of(site / "reference" / "command_line.html")
    for verb in (
        "foam",
        "run",
        "check",
        "defects",
        "view",
        "convert",
        "info",
        "ensemble",
        "partition",
        "figures",
    ):
        assert f'id="warpedfoam-{verb}"' in page, verb


def test_pictures_of_the_pages_are_drawn_by_a_command() -> None:
    """Names only: drawing takes minutes."""
    command = [sys.executable, str(DOCS / "drawing"), "--help"]
    said = subprocess.run(command, capture_output=True, text=True, check=True, env=ENVIRONMENT).stdout
    known = set(re.findall(r"\w+", said))
    drawn = [*DOCS.glob("*.png"), *DOCS.glob("pictures/*.png")]
    assert len(drawn) > 20
    for picture in drawn:
        name = re.sub(r"^(example_main_job)_\d+$", r"\1", picture.stem)
        assert name in known, f"no command draws {picture.name}"


def test_stored_tables_redraw(tmp_path: Path) -> None:
    picture = tmp_path / "order.png"
    table = ROOT / "benchmarks" / "data" / "film_order.csv"
    command = [sys.executable, str(ROOT / "benchmarks" / "convergence.py"), "--redraw", str(table)]
    subprocess.run([*command, "--plot", str(picture)], check=True, env=ENVIRONMENT)
    assert picture.stat().st_size > 10_000


def test_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = EXAMPLES / "main_job.ipynb"
    stored = json.loads(path.read_text(encoding="utf-8"))
    assert not any(cell.get("outputs") for cell in stored["cells"])
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "src"))
    sheet = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(sheet, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    said = "".join(o.get("text", "") for c in sheet.cells for o in c.get("outputs", []))
    assert "converged in" in said
    assert "energy 812.2" in said
    pictures = [
        k for k, c in enumerate(sheet.cells) for o in c.get("outputs", []) if "image/png" in o.get("data", {})
    ]
    kept = {p.name for p in (DOCS / "pictures").glob("example_main_job_*.png")}
    assert kept == {f"example_main_job_{k}.png" for k in pictures}
    assert {p.name for p in tmp_path.iterdir()} == {"foam.npz", "foam.vtp", "foam.html"}
