"""Scrambled files of foams: each is refused clearly or read soundly, none ends the reader or holds it up."""

from __future__ import annotations

from collections import Counter

import pytest

from .mutated_files import KINDS, all_cases
from .test_mutated_meshes import Worker

#: Formats with checksums: what is read is what was written.
SEALED = (".npz", ".h5", ".vtp")


def test_every_scrambled_file_is_refused_or_sound():
    cases = all_cases()
    worker = Worker(limit=30.0, module="tests.mutated_files")
    try:
        found = {case: worker(case) for case in cases}
    finally:
        worker.close()
    bad = {
        case: result
        for case, result in found.items()
        if result["state"] not in ("refused", "same", "other")
        # a digit of a polygon may change: then it is another sound polygon
        or (result["state"] == "other" and case.split("/")[0] in SEALED)
    }
    assert not bad, bad
    states = Counter((case.split("/")[0], result["state"]) for case, result in found.items())
    for kind in KINDS:
        assert found[f"{kind}/whole/0"]["state"] == "same"
        assert states[kind, "refused"] > 30


@pytest.mark.parametrize(("case", "state"), [("stop/crash/0", "CRASHED"), ("stop/hang/0", "HUNG")])
def test_a_reader_that_crashes_or_hangs_is_noticed(case, state):
    worker = Worker(limit=8.0, module="tests.mutated_files")
    try:
        assert worker(".npz/whole/0")["state"] == "same"
        assert worker(case)["state"] == state
    finally:
        worker.close()
