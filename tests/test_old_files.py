"""Files of every version of every schema that there has been are read; of those to come, refused."""

from __future__ import annotations

import gzip
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.io import state, trajectory
from warpedfoam.studies import checkpoint

from .io_foams import sphere_foam
from .test_io_files import _rewritten

DATA = Path(__file__).parent / "data" / "versions"
#: What was in each file when it was written. ``foam_1_first.npz`` is by the first code that wrote version 1,
#: before there were exteriors and gaps that vary; ``_1`` stands for the version.
FACTS: dict[str, list[dict[str, Any]]] = json.loads((DATA / "facts.json").read_text(encoding="utf-8"))
FILES = sorted(path.name for path in DATA.iterdir() if path.name != "facts.json")


def foams_in(name: str, folder: Path) -> list[wf.Foam]:
    if name.endswith(".npz"):
        return [wf.load(DATA / name)]
    if name.endswith(".vtp"):
        return [wf.read_vtp(DATA / name)]
    whole = folder / "old.h5"
    whole.write_bytes(gzip.decompress((DATA / name).read_bytes()))
    with wf.Trajectory(whole) as frames:
        assert frames.times.tolist() == [0.5, 2.0]
        assert (frames.notes(0), frames.notes(1)) == ({"step": 3}, {})
        return list(frames)


@pytest.mark.parametrize("name", FILES)
def test_old_files_hold_what_they_held(name: str, tmp_path: Path) -> None:
    found = foams_in(name, tmp_path)
    assert len(found) == len(FACTS[name])
    for foam, told in zip(found, FACTS[name], strict=True):
        assert foam.vertex_points.tolist() == told["points"]
        assert foam.bubble_ids.tolist() == told["ids"]
        assert foam.network.sides.tolist() == told["sides"]
        assert (foam.tension, foam.seed, foam.exterior) == (told["tension"], told["seed"], told["exterior"])
        assert (None if foam.pressures is None else foam.pressures.tolist()) == told["pressures"]
        assert (repr(foam.cell.surface), repr(foam.cell.gap)) == (told["surface"], told["gap"])
        # these are computed anew
        assert foam.energy == pytest.approx(told["energy"], rel=1e-12)
        np.testing.assert_allclose(foam.bubble_volumes, told["volumes"], rtol=1e-12)


def test_every_version_has_a_file() -> None:
    assert set(FILES) == set(FACTS)
    for kind, newest in (("foam_{}.npz", state.VERSION), ("foam_{}.vtp", state.VERSION)):
        assert {kind.format(k) for k in range(1, newest + 1)} <= set(FILES)
    versions = range(1, trajectory.VERSION + 1)
    assert {f"trajectory_{k}.h5.gz" for k in versions} <= set(FILES)


@pytest.mark.parametrize("version", [0, 2, 99, "1", None, 1.5, [1] * 1000])
def test_versions_that_are_not_known_take_one_sentence(version: Any, tmp_path: Path) -> None:
    path = _rewritten(wf.save(tmp_path / "foam.npz", sphere_foam(12)), {"version": version})
    with pytest.raises(wf.FileFormatError, match=r"is of version .* reads version 1; use a newer") as caught:
        wf.load(path)
    assert len(str(caught.value)) < 400
    assert "\n" not in str(caught.value)


def test_a_newer_checkpoint_is_refused(tmp_path: Path) -> None:
    one = checkpoint.Checkpoint(tmp_path, "run", {"seed": 1})
    one.write({"step": 1}, {})
    told = json.loads(one.path.read_text())
    one.path.write_text(json.dumps({**told, "version": checkpoint.VERSION + 1, "more": 3}))
    with pytest.raises(wf.FileFormatError, match="is of version 2, this warpedfoam reads version 1"):
        one.read()


def test_the_page_states_the_schemas() -> None:
    page = (Path(__file__).parents[1] / "docs/formats.md").read_text(encoding="utf-8")
    for heading, version in (("Saved foams", state.VERSION), ("Trajectories", trajectory.VERSION)):
        section = page.partition(f"## {heading}\n")[2].partition("\n## ")[0]
        assert f"Schema, version {version}." in section
        names = set(re.findall(r"`(\w+)`", section))
        wanted = {*state._INTS, *state._FLOATS, "header"}
        if heading == "Trajectories":
            wanted = {*trajectory._DATA, "time", "index", "format", "version", "cell", "cell_checksum"}
        else:
            wanted |= {*state._TOLD, "exterior"}
        assert wanted <= names, wanted - names
