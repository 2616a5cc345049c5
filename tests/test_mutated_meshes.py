"""Mutated meshes and scrambled files: each ends in a clear refusal or a correct foam, none in a crash."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path

import pytest

from .mutated_meshes import all_cases

#: Seconds for one mesh, from its file to a relaxed foam (3 on an idle core).
LIMIT = 60.0
ROOT = Path(__file__).parents[1]


class Worker:
    """A process that answers cases; a case that ends it or hangs it is known by name."""

    def __init__(self, limit: float = LIMIT, module: str = "tests.mutated_meshes") -> None:
        self.limit, self.module = limit, module
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> subprocess.Popen[str]:
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self.process = subprocess.Popen(
            [sys.executable, "-m", self.module],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, **one, "PYTHONPATH": str(ROOT / "src")},
        )
        self.answers: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._listen, args=(self.process, self.answers), daemon=True).start()
        return self.process

    @staticmethod
    def _listen(process: subprocess.Popen[str], answers: queue.Queue[str]) -> None:
        for line in process.stdout:
            answers.put(line)
        answers.put("")  # it ended

    def __call__(self, case: str) -> dict[str, object]:
        process = self.process or self.start()
        try:
            process.stdin.write(case + "\n")
            process.stdin.flush()
            line = self.answers.get(timeout=self.limit)
        except queue.Empty:
            self.close()
            return {"state": "HUNG", "reason": f"no answer in {self.limit:g} s"}
        except BrokenPipeError:
            line = ""
        if not line:
            code = process.wait()
            self.close()
            return {"state": "CRASHED", "reason": f"exit code {code}"}
        return json.loads(line)

    def close(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process.stdin.close()
            self.process.stdout.close()
            self.process = None


@pytest.mark.slow
def test_every_mutated_mesh_is_refused_clearly_or_carries_a_correct_foam():
    cases = all_cases()
    assert len(cases) == len(set(cases)) > 300
    worker = Worker()
    try:
        found = {case: worker(case) for case in cases}
    finally:
        worker.close()
    bad = {c: r for c, r in found.items() if r["state"] not in ("refused", "converged", "not converged")}
    assert not bad, json.dumps(bad, indent=1)
    states = Counter(result["state"] for result in found.values())
    assert states["converged"] > 30
    assert states["not converged"] <= 2, {c: r for c, r in found.items() if r["state"] == "not converged"}
    # the mutations do what their names say: these must be refused, those must carry a foam
    for case, result in found.items():
        sort, name, _, kind, _ = case.split("/")
        if sort == "mesh":
            assert (result["state"] == "refused") == (not carries(name, kind)), (case, result)
        if sort == "junk":
            assert result.get("stage") == "read", (case, result)


def carries(name: str, kind: str) -> bool:
    """Whether a mutation leaves a mesh that carries a foam, in files of a kind."""
    if name in ("twin_node", "soup"):  # the files that write corners anew have them merged
        return kind in ("obj", "stl", "stlb")
    if name == "spare_node":  # STL has no nodes
        return kind in ("stl", "stlb")
    return name in (
        "inside_out", "sliver", "mild_sliver", "cap", "noise", "shuffled", "tiny", "huge", "off_centre",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("case", "state"), [("stop/crash", "CRASHED"), ("stop/hang", "HUNG"), ("stop/memory", "WRONG")]
)
def test_a_worker_that_crashes_or_hangs_is_noticed(case, state):
    worker = Worker(limit=5.0)
    try:
        # the first answer may wait for imports
        assert worker("junk/empty/none/.ply/0")["state"] == "refused"
        assert worker(case)["state"] == state
        assert worker("junk/empty/none/.ply/0")["state"] == "refused"
    finally:
        worker.close()
