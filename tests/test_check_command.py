"""``warpedfoam check``: what it says of a mesh, what it mends, and what it never touches."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from warpedfoam import MeshSurface, Torus
from warpedfoam.cli.app import app
from warpedfoam.io import write_mesh
from warpedfoam.surfaces import TriangleMesh, mesh_report, read_mesh
from warpedfoam.surfaces.level import LevelSurface

from .test_mesh_health import BALL, NODES, TRIANGLES, mutated


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Integrals over the given mesh are fine enough here."""
    monkeypatch.setattr(LevelSurface, "integral_nodes", 300)


def check(*arguments):
    return CliRunner().invoke(app, ["check", *map(str, arguments)])


def put(path, mesh):
    write_mesh(path, mesh)
    return path


def test_check_of_a_sound_mesh(tmp_path):
    path = put(tmp_path / "ball.ply", BALL)
    result = check(path, "--gap", 0.1, "-n", 20)
    assert result.exit_code == 0
    for text in ("252 nodes", "genus 0", "1 component, 0 rims", "no gap folds", "can carry a foam"):
        assert text in result.output
    assert "repair" not in result.output
    facts = json.loads(check(path, "--json").output)
    assert facts["sound"] is True
    assert facts["findings"] == []
    assert "repair" not in facts


def test_check_offers_a_repair_and_mends_nothing_unasked(tmp_path):
    turned = TRIANGLES.copy()
    turned[7] = turned[7, ::-1]
    path = put(tmp_path / "turned.ply", TriangleMesh(NODES, turned))
    before = path.read_bytes()
    result = check(path)
    assert result.exit_code == 1
    assert "FAULT     triangles turned against a neighbour (3; first: edge at node" in result.output
    assert "would make it sound (turned 1 triangle): add --repair" in result.output
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == before
    facts = json.loads(check(path, "--json").output)
    assert facts["sound"] is False
    assert facts["repair"]["sound"] is True
    assert facts["repair"]["file"] is None


def test_check_takes_a_rim_as_meant_and_says_what_it_means(tmp_path):
    path = put(tmp_path / "cut.ply", TriangleMesh(NODES, TRIANGLES[1:]))
    result = check(path)
    assert result.exit_code == 0
    assert "note      open edges (3; first: edge at node" in result.output
    assert "films end on such a rim at 90 degrees; if it is damage, close it" in result.output
    assert "genus 0" in result.output
    assert "1 rim" in result.output


def test_check_repairs_into_a_new_file(tmp_path):
    path = put(tmp_path / "cut.ply", TriangleMesh(NODES, TRIANGLES[1:]))
    new = tmp_path / "new.ply"
    result = check(path, "--repair", new, "--json")
    assert result.exit_code == 0
    facts = json.loads(result.output)
    assert facts["repair"]["done"] == ["closed 1 hole"]
    assert facts["repair"]["file"] == str(new)
    assert mesh_report(read_mesh(new)).sound
    assert check(new).exit_code == 0


def test_check_never_overwrites(tmp_path):
    path = put(tmp_path / "cut.ply", TriangleMesh(NODES, TRIANGLES[1:]))
    other = put(tmp_path / "other.ply", BALL)
    link = tmp_path / "link.ply"
    link.symlink_to(tmp_path / "nowhere.ply")
    for target in (path, other, link):
        before = target.read_bytes() if target.exists() else None
        result = check(path, "--repair", target)
        assert result.exit_code == 2
        assert "choose another name" in result.stderr
        assert (target.read_bytes() if target.exists() else None) == before


def test_check_closes_larger_holes_when_told(tmp_path):
    path = put(tmp_path / "cut.ply", TriangleMesh(*used(NODES, TRIANGLES[~(TRIANGLES == 40).any(axis=1)])))
    result = check(path, "-n", 50)
    assert "small rim for 50 bubbles" in result.output
    assert "--close-holes" in result.output
    result = check(path, "--close-holes", 8)
    assert result.exit_code == 2
    assert "add --repair" in result.stderr
    result = check(path, "--repair", tmp_path / "new.ply", "--close-holes", 3)
    assert result.exit_code == 2
    assert "--close-holes must" in result.stderr
    facts = json.loads(check(path, "--repair", tmp_path / "new.ply", "--close-holes", 8, "--json").output)
    assert facts["repair"]["done"] == ["closed 1 hole"]
    assert facts["repair"]["rims"] == 0


def test_a_foam_on_a_mesh_with_a_small_hole_says_so_first(tmp_path, monkeypatch):
    path = put(tmp_path / "cut.ply", TriangleMesh(*used(NODES, TRIANGLES[~(TRIANGLES == 40).any(axis=1)])))

    surface = MeshSurface.from_file(path)

    def reached(*_):
        raise ValueError("far enough")

    monkeypatch.setattr("warpedfoam.cli.job.run_job", reached)
    job = ["foam", str(path), "-n", "60", "--gap", "0.01", "-o", str(tmp_path / "out")]
    result = CliRunner().invoke(app, job)
    assert f"too small for bubbles {(surface.area / 60) ** 0.5:.3g} wide" in result.stderr
    assert f"warpedfoam check {path} --repair" in result.stderr
    assert "too small" not in CliRunner().invoke(app, [*job, "--quiet"]).stderr
    # a rim with room for bubbles is meant
    away = NODES[TRIANGLES].mean(axis=1)[:, 2] < 0.7
    job[1] = str(put(tmp_path / "bowl.ply", TriangleMesh(*used(NODES, TRIANGLES[away]))))
    result = CliRunner().invoke(app, job)
    assert "far enough" in result.stderr
    assert "too small" not in result.stderr


def used(nodes, triangles):
    """Without nodes that no triangle has."""
    kept, inverse = np.unique(triangles, return_inverse=True)
    return nodes[kept], inverse.reshape(-1, 3)


def test_check_writes_nothing_that_is_still_unsound(tmp_path):
    path = put(tmp_path / "bad.ply", mutated("spike"))
    new = tmp_path / "new.ply"
    result = check(path, "--repair", new)
    assert result.exit_code == 1
    assert "not written" in result.output
    assert not new.exists()
    assert "no safe one" in check(path).output
    # nor for a gap that would fold on it
    ring = put(tmp_path / "ring.ply", Torus(3.0, 1.0).triangulate(900))
    assert check(ring, "--gap", 5, "--repair", new).exit_code == 1
    assert not new.exists()


def test_a_write_that_fails_leaves_nothing(tmp_path, monkeypatch):
    path = put(tmp_path / "cut.ply", TriangleMesh(NODES, TRIANGLES[1:]))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("warpedfoam.io.atomic.os.fsync", full)
    result = check(path, "--repair", tmp_path / "new.ply")
    assert result.exit_code == 2
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["immense", "point", "far_off", "kissing", "spike", "all_flat"])
def test_json_of_any_fault_can_be_parsed(name, tmp_path):
    mesh = TriangleMesh(NODES, [[0, 0, 1]]) if name == "all_flat" else mutated(name)
    result = check(put(tmp_path / "m.ply", mesh), "--json")
    assert result.exit_code == 1

    def refuse(word):
        raise AssertionError(word)

    assert json.loads(result.output, parse_constant=refuse)["sound"] is False


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--gap", "0"], "gap must be greater than 0"),
        (["--gap", "nan"], "gap must be finite"),
        (["-n", "0"], "n_bubbles must be at least 1"),
        (["-n", "many"], "valid integer"),
        (["--repair", "no/such/folder.ply"], "no folder"),
        (["--repair", "new.obj"], ".ply"),
        (["--repair", ""], "must name a file"),
    ],
)
def test_check_refuses_bad_arguments(arguments, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = put(tmp_path / "ball.ply", BALL)
    result = check(path, *arguments)
    assert result.exit_code == 2
    assert text in result.stderr
    assert list(tmp_path.iterdir()) == [path]


def test_check_of_no_mesh(tmp_path):
    assert check(tmp_path / "none.ply").exit_code == 2
    junk = tmp_path / "junk.stl"
    junk.write_bytes(b"junk" * 100)
    result = check(junk)
    assert result.exit_code == 2
    assert "damaged" in result.stderr
