"""The Python of README.md and of the pages under docs/ runs and does what the text says."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.sizes import SIZES
from warpedfoam.studies.observables import COORDINATES, GROUPS, SINGLE
from warpedfoam.surfaces import Layer

ROOT = Path(__file__).parents[1]
WRITTEN = [
    page
    for page in sorted((ROOT / "docs").rglob("*.md"))
    # the others are made by the build of the site
    if page.relative_to(ROOT / "docs").parts[0] not in {"gallery", "reference", "_build"}
]
PAGES = [ROOT / "README.md", *WRITTEN]
#: What the other tests, and those below, say; they name the pages that they run.
TESTS = "".join(p.read_text(encoding="utf-8") for p in Path(__file__).parent.glob("test_*.py"))
#: Pages with Python that no other test names.
FREE = [p for p in WRITTEN if "\n```python\n" in p.read_text(encoding="utf-8") and f'"{p.name}"' not in TESTS]
#: Lines that a surface may take in the how-to, blank ones not counted.
MOST_LINES = 30


def blocks(page: Path) -> list[str]:
    """Code between ```python fences, in order."""
    found = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert found, f"{page.name} has no Python"
    return found


def run(page: Path) -> dict[str, Any]:
    """All blocks of a page, one after the other, in one namespace."""
    # classes find their module by name
    space: dict[str, Any] = {"__name__": "__main__"}
    for k, block in enumerate(blocks(page)):
        exec(compile(block, f"{page.name}, block {k}", "exec"), space)
    return space


@pytest.mark.parametrize("page", FREE, ids=lambda page: page.stem)
def test_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages check themselves, with ``assert`` where the text claims something."""
    monkeypatch.chdir(tmp_path)
    assert run(page)


@pytest.fixture(scope="module")
def surfaces() -> dict[str, Any]:
    return run(ROOT / "docs" / "surfaces.md")


def test_readme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    space = run(ROOT / "README.md")
    assert space["relaxed"].converged
    assert space["relaxed"].foam.network.charges.sum() == 0
    assert {p.name for p in tmp_path.iterdir()} == {"foam.ply", "foam_view.ply"}


def test_formats(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    space = run(ROOT / "docs" / "formats.md")
    assert space["again"].n_bubbles == 30
    assert {p.name for p in tmp_path.iterdir()} == {"foam.vtp", "foam.obj", "run.h5", "foam.fe"}


def test_the_mesh_of_the_page_is_the_torus(surfaces: dict[str, Any]) -> None:
    assert surfaces["ring"].euler_characteristic == 0
    assert surfaces["ring"].area == pytest.approx(4 * np.pi**2 * 80, rel=1e-4)


def test_the_foam_with_rims_of_the_page(surfaces: dict[str, Any]) -> None:
    foam = surfaces["open_foam"]
    assert len(foam.walls.bubble) > 10
    assert foam.network.charges.sum() == 0
    assert wf.equilibrium_report(foam).wall_error < 0.05 / 6.0


def test_the_how_to_is_short() -> None:
    classes = [
        (block, node)
        for block in blocks(ROOT / "docs" / "surfaces.md")
        for node in ast.parse(block).body
        if isinstance(node, ast.ClassDef)
    ]
    assert len(classes) == 1
    block, node = classes[0]
    first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
    lines = block.splitlines()[first - 1 : node.end_lineno]
    assert sum(bool(line.strip()) for line in lines) <= MOST_LINES


def test_derivatives_of_the_how_to(surfaces: dict[str, Any]) -> None:
    """On the surface and off it, for another shape than the page's."""
    peanut = surfaces["Peanut"](c=1.3, b=1.9)
    x = peanut.random_points(60, 1)
    x = x + 0.05 * np.random.default_rng(2).standard_normal(x.shape)
    value, gradient, bend = peanut.level(x, second=True)
    np.testing.assert_array_equal(peanut.level(x, second=False)[0], value)
    np.testing.assert_array_equal(peanut.level(x, second=False)[1], gradient)
    h = 1e-5
    for k, e in enumerate(np.eye(3)):
        ahead, behind = peanut.level(x + h * e, second=False), peanut.level(x - h * e, second=False)
        np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), gradient[:, k], atol=1e-6)
        np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), bend[:, k], atol=1e-6)


def test_the_surface_of_the_how_to(surfaces: dict[str, Any]) -> None:
    peanut = surfaces["peanut"]
    ends = np.array(
        [[0.0, 0.0, np.hypot(peanut.b, peanut.c)], [np.sqrt(peanut.b**2 - peanut.c**2), 0.0, 0.0]]
    )
    np.testing.assert_allclose(peanut.project(ends), ends, atol=1e-12)
    np.testing.assert_allclose(peanut.normals(ends), [[0, 0, 1], [1, 0, 0]], atol=1e-12)
    assert (np.linalg.norm(peanut.random_points(500, 0), axis=1) <= peanut.size * (1 + 1e-9)).all()
    assert peanut.integral(Layer.curvature()) == pytest.approx(4 * np.pi, abs=1e-6)
    assert len(peanut.rigid_motions(ends)) == 1


def test_the_foam_of_the_how_to(surfaces: dict[str, Any]) -> None:
    relaxed = surfaces["relaxed"]
    assert relaxed.converged
    assert relaxed.foam.cell.surface is surfaces["peanut"]
    assert surfaces["charges"].sum() == 12
    # random foams: the charge round the waist scatters, its sign does not
    assert surfaces["charges"][surfaces["waist"]].sum() < 0


def test_the_page_on_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run(ROOT / "docs" / "pictures.md")
    assert {p.name for p in tmp_path.iterdir()} == {"foam.png", "map.svg", "column.pdf", "angles.png"}
    text = (ROOT / "docs" / "pictures.md").read_text(encoding="utf-8")
    for name in wf.__all__:
        if name.startswith("plot_"):
            assert f"`{name}`" in text


def test_the_theory_page() -> None:
    space = run(ROOT / "docs" / "theory.md")
    films = [0.999517699, 1.000019111, 1.000791843]  # as printed on the page
    v, d = space["volume"], space["gap"]
    k1, k2 = wf.theory.torus_curvatures(np.radians([0.0, 90.0, 180.0]), 20.0, 4.0)
    np.testing.assert_allclose(wf.theory.second_order_ratio(v, d, k1, k2), films, atol=2e-6)
    assert np.abs(wf.theory.fitted_ratio(1.0, v, d, k1 * k2) - films).max() > 1e-5
    assert space["measured"].perimeter == pytest.approx(
        space["traced"].perimeter, abs=space["measured"].error
    )


def test_the_ensembles_page() -> None:
    space = run(ROOT / "docs" / "ensembles.md")
    assert space["ensemble"].counts["converged"] == 8
    assert len(space["foams"]) == 4
    assert all(foam.network.charges.sum() == 0 for foam in space["foams"])


def test_the_study_of_the_ensembles_page(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "ensembles.md").read_text(encoding="utf-8")
    (study,) = re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    (tmp_path / "study.toml").write_text(study, encoding="utf-8")
    assert len(wf.read_study(tmp_path / "study.toml").runs) == 2 * 3 * 3 * 20
    for name in (*SINGLE, *GROUPS, *COORDINATES):
        assert f"`{name}`" in text


def test_the_table_has_every_surface() -> None:
    text = (ROOT / "docs" / "surfaces.md").read_text(encoding="utf-8")
    for name in wf.__all__:
        item = getattr(wf, name)
        if (
            isinstance(item, type)
            and hasattr(item, "curvature_range")
            and name not in {"Surface", "LevelSurface"}
        ):
            assert f"| `{name}` |" in text
    for kind in SIZES:
        assert f"`foam {kind.replace('_', '-')}" in text
        assert f"`{kind}`" in text


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_the_motion_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("h5py")
    monkeypatch.chdir(tmp_path)
    space = run(ROOT / "docs" / "motion.md")
    assert space["moved"].completed
    assert (np.diff(space["angle"]) < 0.0).all()
    assert (np.diff(space["moved"].step_energies) < 0.0).all()


def test_the_coarsening_page() -> None:
    space = run(ROOT / "docs" / "coarsening.md")
    assert space["run"].completed
    foam = space["foam"]
    law = np.pi / 3.0 * (foam.network.sides - 6) + foam.bubble_areas
    np.testing.assert_allclose(space["rate"] / 0.01, law, atol=1e-3)
    assert space["run"].foam.n_bubbles <= 30
