"""Studies: grids, seeds, sizes from aspect ratios, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warpedfoam import Study, read_study
from warpedfoam.studies.study import Run, plates_of

TORUS = {"kind": "torus", "area": 400.0, "aspect_ratio": 3.0}
GRID = {"surface.aspect_ratio": [1.5, 4.0], "foam.volumes": [0.0, 0.2, 0.4]}


def study(**changes: Any) -> Study:
    return Study(**{"repeats": 2, "surface": TORUS, "cell": {"gap": 0.1}, "grid": GRID, **changes})


def point(run: Run) -> tuple[Any, ...]:
    return (*run.parameters.values(), run.repeat)


def test_repeats_vary_fastest_then_the_last_axis() -> None:
    runs = study().runs
    assert [run.number for run in runs] == list(range(12))
    expected = [(a, v, k) for a in (1.5, 4.0) for v in (0.0, 0.2, 0.4) for k in (0, 1)]
    assert [point(run)[3:] for run in runs] == expected
    assert len({run.seed for run in runs}) == len({run.key for run in runs}) == 12


def test_seeds_are_children_of_the_root() -> None:
    children = np.random.SeedSequence(7).spawn(3)
    expected = [int(c.generate_state(1, np.uint64)[0]) >> 1 for c in children]
    runs = study(seed=7, repeats=3, same_seeds=True).runs
    assert [run.seed for run in runs] == expected * 6
    assert max(run.seed for run in runs) < 2**63


def test_runs_stay_the_same_while_a_study_grows() -> None:
    before = {point(run): (run.seed, run.key) for run in study().runs}
    grid = {"surface.aspect_ratio": [8.0, 4.0, 1.5], "foam.volumes": [0.0, 0.1, 0.2, 0.4]}
    after = {point(run): (run.seed, run.key) for run in study(repeats=3, grid=grid).runs}
    assert len(after) == 36
    assert {place: after[place] for place in before} == before


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 1},
        {"cell": {"gap": 0.2}},
        {"observables": ["energy"]},
        {"relax": {"order": 6}},
        {"foam": {"lloyd": 1}},
        {"surface": {**TORUS, "area": 401.0}},
    ],
)
def test_whatever_changes_results_changes_the_key(change: dict[str, Any]) -> None:
    assert {run.key for run in study().runs}.isdisjoint(run.key for run in study(**change).runs)


def test_solvers_share_seeds_but_not_results() -> None:
    one, two = study(), study(relax={"solver": "pardiso", "order": 5})
    assert [run.seed for run in one.runs] == [run.seed for run in two.runs]


def test_the_solver_does_not_depend_on_what_is_installed() -> None:
    assert study().runs[0].values["relax"]["solver"] == "superlu"
    assert study(relax={"solver": "auto"}).runs[0].key == study().runs[0].key


def test_given_seeds_take_the_place_of_repeats() -> None:
    runs = study(grid={"foam.n_bubbles": [50, 60], "seed": [3, 1, 4]}).runs
    assert [run.seed for run in runs] == [3, 1, 4, 3, 1, 4]
    assert "seed" not in runs[0].parameters


@pytest.mark.parametrize(
    "sizes",
    [
        {"area": 400.0, "aspect_ratio": 3.0},
        {"area": 400.0, "major_radius": (300.0 / (4.0 * np.pi**2)) ** 0.5 * 2.0},
        {"aspect_ratio": 3.0, "minor_radius": (400.0 / (12.0 * np.pi**2)) ** 0.5},
        {"aspect_ratio": 3.0, "major_radius": 3.0 * (400.0 / (12.0 * np.pi**2)) ** 0.5},
        {"area": 400.0, "minor_radius": (400.0 / (12.0 * np.pi**2)) ** 0.5},
    ],
)
def test_a_torus_from_any_two_sizes(sizes: dict[str, float]) -> None:
    (run,) = Study(surface={"kind": "torus", **sizes}, cell={"gap": 0.1}).runs
    surface: Any = plates_of(run.values).surface
    assert surface.area == pytest.approx(400.0, rel=1e-13)
    assert surface.major_radius / surface.minor_radius == pytest.approx(3.0, rel=1e-13)


def test_a_sphere_from_its_area() -> None:
    (run,) = Study(surface={"kind": "sphere", "area": 400.0}, cell={"gap": 0.1}).runs
    assert plates_of(run.values).surface.area == pytest.approx(400.0, rel=1e-14)


def test_cases_bring_their_own_surfaces() -> None:
    runs = study(
        repeats=1,
        surface={"kind": "torus", "major_radius": 9.0, "minor_radius": 3.0},
        grid={"foam": {"n_bubbles": [50, 60]}},
        cases=[{"name": "ball", "surface": {"kind": "sphere", "radius": 5.0}}, {"surface.minor_radius": 2.0}],
    ).runs
    assert [run.parameters["case"] for run in runs] == ["ball", "ball", "1", "1"]
    assert [run.parameters["surface.kind"] for run in runs] == ["sphere"] * 2 + ["torus"] * 2
    assert runs[0].values["surface"] == {"kind": "sphere", "radius": 5.0}
    assert runs[2].values["surface"] == {"kind": "torus", "major_radius": 9.0, "minor_radius": 2.0}
    assert [run.parameters["foam.n_bubbles"] for run in runs] == [50, 60, 50, 60]


def test_a_mesh_counts_by_what_is_in_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1)
    monkeypatch.setattr("warpedfoam.studies.study.plates_of", lambda _: None)
    keys = []
    for name in ("one.ply", "two.ply", "three.ply"):
        if name == "three.ply":
            ball.apply_scale(1.1)
        ball.export(tmp_path / name)
        made = Study(surface={"kind": "mesh", "file": str(tmp_path / name)}, cell={"gap": 0.01})
        keys.append((made.runs[0].key, made.runs[0].seed))
    assert keys[0] == keys[1]
    assert keys[0] != keys[2]


BAD: list[tuple[dict[str, Any], str]] = [
    ({"seed": -1}, "study: seed must be at least 0"),
    ({"repeats": 0}, "study: repeats must be at least 1"),
    ({"same_seeds": 1}, "study: same_seeds must be True or False"),
    ({"surface": 3}, r"surface must be a section"),
    ({"observables": "energy"}, "observables must be a list"),
    ({"observables": []}, "observables must name at least one"),
    ({"observables": ["enregy"]}, r"observables\[0\]: unknown observable 'enregy'; did you mean energy"),
    ({"observables": ["defects.scars"]}, "did you mean defects.charges"),
    ({"observables": ["energy", "energy"]}, "two observables would have the columns energy"),
    ({"observables": [3]}, "must be the name of an observable"),
    ({"observables": ["nowhere:f"]}, "nowhere:f cannot be imported: ModuleNotFoundError"),
    ({"observables": ["math:pi"]}, "math:pi is a float, not a function"),
    ({"observables": ["math:"]}, "must be written as module:function"),
    ({"observables": [{"kind": "profile"}]}, "kind must be 'charge_profile'"),
    ({"observables": [{"kind": "charge_profile", "edges": [0, 1]}]}, "coordinate must be one of x, y"),
    ({"observables": [{"kind": "charge_profile", "coordinate": "z", "edges": [1, 0]}]}, "ascending"),
    ({"observables": [{"kind": "charge_profile", "coordinate": "z", "bands": 3}]}, "unknown option bands"),
    ({"grid": {"foam.n_bubles": [1]}}, "unknown option foam.n_bubles; did you mean foam.n_bubbles"),
    ({"grid": {"bubbles": [1]}}, "unknown option bubbles"),
    ({"grid": {"foam.n_bubbles": 50}}, "grid.foam.n_bubbles must be a list of values, got 50"),
    ({"grid": {"foam.n_bubbles": []}}, "grid.foam.n_bubbles must be a list of values"),
    ({"grid": {"foam.n_bubbles": [50.5]}}, "study, grid: foam.n_bubbles must be an integer"),
    ({"grid": {"foam.n_bubbles": [50, 50]}}, "two runs are the same"),
    ({"grid": {"seed": [1.5]}}, "grid.seed must be an integer"),
    ({"grid": {"output.picture": [True]}}, "unknown option output.picture"),
    ({"grid": {"surface.radius": [1.0]}}, "study, grid: unknown option surface.radius"),
    ({"grid": {"cell.gap": [0.1, 20.0]}, "surface": {"kind": "torus"}}, "must be less than|grid"),
    ({"grid": {"foam.n_bubbles": list(range(4, 2000)), "seed": list(range(1000))}}, "runs are more than"),
    ({"surface": {**TORUS, "minor_radius": 1.0}}, r"any two of aspect_ratio, area, major_radius, minor"),
    ({"surface": {"kind": "sphere", "area": 1.0, "radius": 1.0}, "grid": {}}, "any one of area, radius"),
    ({"surface": {"kind": "torus", "aspect_ratio": 0.5, "area": 9.0}, "grid": {}}, "study: "),
    ({"cases": [3]}, r"cases\[0\] must be a table"),
    ({"cases": [{"name": 3}]}, r"cases\[0\].name must be a text"),
    ({"cases": [{"foam.lloyds": 3}]}, "unknown option foam.lloyds; did you mean foam.lloyd"),
    (
        {
            "surface": {"kind": "sphere"},
            "grid": {},
            "observables": [{"kind": "charge_profile", "coordinate": "tube_angle", "edges": [0, 180]}],
        },
        "tube_angle needs a torus, got a sphere",
    ),
]


@pytest.mark.parametrize(("change", "message"), BAD, ids=[message[:30] for _, message in BAD])
def test_bad_studies_are_refused_by_name(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        study(**change)


TEXT = """
seed = 5
repeats = 2
observables = ["energy", "charges"]
[surface]
kind = "torus"
area = 300.0
[cell]
gap = 0.1
[grid]
surface.aspect_ratio = [2.0, 3.0]
foam.n_bubbles = [40, 50]
"""


def test_a_file_is_the_study_it_describes(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(TEXT)
    made = Study(
        seed=5,
        repeats=2,
        observables=("energy", "charges"),
        surface={"kind": "torus", "area": 300.0},
        cell={"gap": 0.1},
        grid={"surface": {"aspect_ratio": [2.0, 3.0]}, "foam": {"n_bubbles": [40, 50]}},
    )
    assert [run.key for run in read_study(path).runs] == [run.key for run in made.runs]
    assert read_study(path, ["repeats=1", "cell.gap=0.2"]).runs[0].values["cell"]["gap"] == 0.2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("repeat = 3", "study.toml: unknown option repeat; did you mean repeats"),
        ("[serface]\nkind = 'torus'", "study.toml: unknown section serface; did you mean surface"),
        ("[foam]\nbubbles = 3", "study.toml: unknown option foam.bubbles; did you mean foam.n_bubbles"),
        ("repeats = ", "study.toml is not a TOML file"),
        ("[output]\nfolder = 'x'", "unknown section output"),
    ],
)
def test_bad_files_are_refused_by_name(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_study(path)
