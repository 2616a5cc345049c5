"""The package as a whole: light to import, its layers complete, its papers in agreement."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import warpedfoam

ROOT = Path(__file__).parents[1]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
HEAVY = {
    "matplotlib", "trimesh", "igl", "networkx", "rich", "typer", "click", "pyvista", "pypardiso",
    "scipy.optimize", "scipy.stats", "pandas", "tomllib", "dask", "distributed", "pyarrow", "threadpoolctl",
}  # fmt: skip


def modules_after(statement: str) -> set[str]:
    code = f"{statement}; import sys; print('\\n'.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_import_is_light() -> None:
    # with every name of the package, and the machinery that it stands for
    assert HEAVY & modules_after("from warpedfoam import *; import warpedfoam.studies.options") == set()


def test_import_alone_waits_for_what_is_asked_for() -> None:
    loaded = modules_after("import warpedfoam")
    assert {"numpy", "scipy", "numba", "h5py", *HEAVY} & loaded == set()
    assert "scipy" not in modules_after("import warpedfoam as wf; wf.MeshError, wf.theory.bubbles")
    assert {"warpedfoam.plot", "warpedfoam.studies"} & modules_after(
        "import warpedfoam as wf; wf.relax"
    ) == set()


def test_names_are_where_type_checkers_find_them() -> None:
    """The imports that only type checkers read, the table that is read instead, and `__all__`."""
    source = Path(warpedfoam.__file__).read_text(encoding="utf-8")
    (block,) = [
        n for n in ast.parse(source).body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"
    ]
    checked = {}
    for node in block.body:
        assert isinstance(node, ast.ImportFrom)
        checked.update({alias.name: node.module for alias in node.names})
    assert sorted(checked) == warpedfoam.__all__
    for name, module in checked.items():
        home = importlib.import_module(str(module))
        wanted = importlib.import_module(f"{module}.{name}") if name == "theory" else getattr(home, name)
        assert getattr(warpedfoam, name) is wanted, name
    assert set(warpedfoam._HOME_OF) | {"theory"} == set(checked)
    with pytest.raises(AttributeError, match="module 'warpedfoam' has no attribute 'foams'"):
        warpedfoam.foams  # type: ignore[attr-defined]  # noqa: B018
    assert set(warpedfoam.__all__) <= set(dir(warpedfoam))


@pytest.mark.parametrize(
    "first",
    ["import warpedfoam.relax.driver", "import warpedfoam.studies", "from warpedfoam import relax", "pass"],
)
def test_relax_is_the_function_whatever_is_imported_first(first: str) -> None:
    code = (
        f"{first}\nimport warpedfoam as wf, importlib\nassert callable(wf.relax), wf.relax\n"
        "import warpedfoam.relax.kkt\nfrom warpedfoam.relax.driver import relax as same\n"
        "assert wf.relax is same\nassert importlib.import_module('warpedfoam.relax').relax is same"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_command_answers_without_loading_the_machinery() -> None:
    loaded = modules_after("import warpedfoam.cli.app")
    assert {"numpy", "scipy", "matplotlib", "trimesh", "igl", "networkx"} & loaded == set()


def test_every_module_has_its_layer() -> None:
    contracts = {c["id"]: c for c in PROJECT["tool"]["importlinter"]["contracts"]}
    layers = [{name.strip(" ()") for name in layer.split("|")} for layer in contracts["layers"]["layers"]]
    source = ROOT / "src" / "warpedfoam"
    present = {p.stem for p in source.glob("*.py") if p.stem != "__init__"}
    present |= {p.parent.name for p in source.glob("*/__init__.py")}
    assert present <= set().union(*layers)
    assert set().union(*layers) - present <= {"studies"}  # to come
    place = {name: i for i, layer in enumerate(layers) for name in layer}
    order = [
        "cli",
        "plot",
        "studies",
        "motion",
        "relax",
        "energy",
        "foam",
        "cell",
        "surfaces",
        "kernels",
        "arrays",
    ]
    assert [place[name] for name in order] == list(range(len(layers) - 1))
    siblings = ({"tessellate", "energy", "moves", "analysis", "io"}, {"surfaces", "network"})
    assert all(group in layers for group in siblings)
    assert contracts["layers"]["exhaustive"] is True


def test_papers_agree_on_the_version() -> None:
    number = PROJECT["project"]["version"]
    assert version("warpedfoam") == number
    assert f"\nversion: {number}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {number}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "MIT License" in (ROOT / "LICENSE").read_text(encoding="utf-8")


def test_developers_get_the_fast_solver_where_there_is_one() -> None:
    from packaging.requirements import Requirement  # pytest needs it too

    extras = PROJECT["project"]["optional-dependencies"]
    (own,) = [r for text in extras["dev"] if (r := Requirement(text)).name == "warpedfoam"]
    assert own.extras == {"fast", "formats", "test", "docs"}
    (fast,) = [r for r in map(Requirement, extras["fast"]) if r.name == "pypardiso"]
    assert {Requirement(text).name for text in extras["fast"]} == {"numba", "pypardiso"}
    assert fast.marker is not None
    found = {
        (machine, system)
        for machine in ("x86_64", "AMD64", "aarch64", "arm64", "ARM64")
        for system in ("linux", "darwin", "win32")
        if fast.marker.evaluate({"platform_machine": machine, "sys_platform": system})
    }
    assert found == {("x86_64", "linux"), ("AMD64", "win32")}
    assert 'install("[dev]")' in (ROOT / "run.py").read_text(encoding="utf-8")


def test_readme_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    code = text.split("```python\n")[1].split("```")[0]
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert names["relaxed"].converged
    assert names["relaxed"].foam.network.charges.sum() == 0
    assert (tmp_path / "foam.ply").exists()


def test_readme_names_files_that_exist() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    links = [part.split(")")[0] for part in text.split("](")[1:]]
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.fixture
def run_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("run_script", ROOT / "run.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_run_script_is_readable_by_old_pythons_and_needs_nothing(run_script: ModuleType) -> None:
    source = (ROOT / "run.py").read_text(encoding="utf-8")
    tree = ast.parse(source, feature_version=(3, 7))
    imported = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    assert {name.split(".")[0] for name in imported} <= sys.stdlib_module_names
    assert not any(isinstance(node, (ast.JoinedStr, ast.ImportFrom)) for node in ast.walk(tree))
    wanted = PROJECT["project"]["requires-python"]
    assert wanted == ">={}.{}".format(*run_script.OLDEST)


def test_run_script_refuses_old_pythons(
    run_script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run_script, "OLDEST", (99, 0))
    with pytest.raises(SystemExit) as end:
        run_script.use_new_enough_python()
    assert end.value.code == 2
    assert "needs Python 99.0 or newer" in capsys.readouterr().err


def test_run_script_installs_once_per_project_file(
    run_script: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    calls: list[list[str]] = []

    def pretend(command: list[str], **_: object) -> int:
        calls.append(command)
        return 0

    (tmp_path / "pyproject.toml").write_text("one")
    (tmp_path / ".venv").mkdir()
    monkeypatch.setattr(run_script, "HERE", str(tmp_path))
    monkeypatch.setattr(run_script, "STAMP", str(tmp_path / ".venv" / "stamp"))
    monkeypatch.setattr(run_script, "PYTHON", sys.executable)
    monkeypatch.setattr(run_script.subprocess, "call", pretend)

    def installs() -> int:
        return sum("install" in command for command in calls)

    run_script.install("[dev]")
    assert installs() == 1
    run_script.install("[dev]")
    run_script.install()
    assert installs() == 1
    (tmp_path / "pyproject.toml").write_text("two")
    run_script.install()
    assert installs() == 2
    run_script.install("[dev]")
    assert installs() == 3


def test_run_script_explains_itself() -> None:
    done = subprocess.run([sys.executable, str(ROOT / "run.py")], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "run.py foam" in done.stderr
    assert "run.py test" in done.stderr
