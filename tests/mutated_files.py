"""Foams in files of every format, scrambled, and the worker process that reads them.

Run as a module (``python -m tests.mutated_files``) it reads names of cases, one a line, and answers each
with one line of JSON.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

#: Endings of the files that hold foams, and how often each scramble is tried with another seed.
KINDS = (".npz", ".h5", ".vtp", ".ply", ".obj", ".dmp", ".fe")
SCRAMBLES = {
    "cut": 12,
    "bit": 30,
    "bytes": 12,
    "block": 8,
    "swap": 6,
    "number": 12,
    "more": 2,
    "junk": 2,
    "whole": 1,
}
MEMORY = 4 << 30

DUMP = Path(__file__).parent / "data" / "evolver" / "sphere_12.dmp"


def all_cases() -> list[str]:
    """Names ``ending/scramble/seed``."""
    return [f"{kind}/{name}/{k}" for kind in KINDS for name, count in SCRAMBLES.items() for k in range(count)]


def whole_files(folder: Path) -> dict[str, bytes]:
    """A sound file of each kind."""
    from tests.io_foams import sphere_foam, with_pressures
    from warpedfoam import TrajectoryWriter, save, write_fe, write_obj, write_ply, write_vtp

    foam = with_pressures(sphere_foam(12, even=True))
    save(folder / "foam.npz", foam)
    write_vtp(folder / "foam.vtp", foam, curve_points=3)
    write_ply(folder / "foam.ply", foam, curve_points=3)
    write_obj(folder / "foam.obj", foam, curve_points=3)
    write_fe(folder / "foam.fe", foam, segments=2)
    with TrajectoryWriter(folder / "foam.h5") as writer:
        for _ in range(3):
            writer.append(foam)
    found = {kind: (folder / f"foam{kind}").read_bytes() for kind in KINDS if kind != ".dmp"}
    return {**found, ".dmp": DUMP.read_bytes()}


def scrambled(data: bytes, name: str, rng: np.random.Generator) -> bytes:
    """The bytes after one scramble."""
    raw = np.frombuffer(data, dtype=np.uint8).copy()
    at = int(rng.integers(len(raw)))
    if name == "cut":
        return data[: int(rng.uniform(0.0, 1.0) * len(data))]
    if name == "bit":
        raw[at] ^= 1 << int(rng.integers(8))
    elif name == "bytes":
        raw[rng.integers(len(raw), size=20)] = rng.integers(256, size=20)
    elif name == "block":
        raw[at : at + 512] = 0
    elif name == "swap":
        other = int(rng.integers(len(raw)))
        a, b = raw[at : at + 64].copy(), raw[other : other + 64].copy()
        size = min(len(a), len(b))
        raw[at : at + size], raw[other : other + size] = b[:size], a[:size]
    elif name == "number":
        digits = np.flatnonzero((raw >= 48) & (raw < 58))
        raw[digits[int(rng.integers(len(digits)))]] = 48 + int(rng.integers(10))
    elif name == "more":
        return data + bytes(rng.integers(256, size=300).astype(np.uint8))
    elif name == "junk":
        return bytes(rng.integers(256, size=3000).astype(np.uint8))
    return raw.tobytes()


class Reader:
    """Reads scrambled files and tells what came of it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.whole = whole_files(folder)
        self.sound = {kind: self.read(kind, data) for kind, data in self.whole.items()}

    def read(self, kind: str, data: bytes) -> list[bytes]:
        """What a file says, as bytes to compare."""
        import warpedfoam as wf

        path = self.folder / f"case{kind}"
        path.write_bytes(data)
        if kind == ".dmp":
            dump = wf.read_dmp(path)
            return [dump.points.tobytes(), dump.edges.tobytes(), repr((dump.energy, dump.pressures)).encode()]
        if kind == ".npz":
            foams = [wf.load(path)]
        elif kind == ".vtp":
            foams = [wf.read_vtp(path)]
        elif kind == ".h5":
            with wf.Trajectory(path) as frames:
                foams = list(frames)
        else:
            from warpedfoam import HeleShawCell, Sphere

            foams = [wf.import_polygons(path, HeleShawCell(Sphere(2.0), gap=0.1))]
        names = ("vertex_points", "film_offsets", "target_volumes", "bubble_ids")
        nets = ("next", "origin", "bubble", "bubble_euler")
        return [
            b"".join(
                [getattr(f, n).tobytes() for n in names] + [getattr(f.network, n).tobytes() for n in nets]
            )
            + repr((f.energy, f.tension, f.cell, f.seed)).encode()
            for f in foams
        ]

    def __call__(self, case: str) -> dict[str, object]:
        if case == "stop/crash/0":
            import os

            os.abort()
        if case == "stop/hang/0":
            time.sleep(1000.0)
        kind, name, seed = case.split("/")
        rng = np.random.default_rng([int(seed), KINDS.index(kind), list(SCRAMBLES).index(name)])
        data = scrambled(self.whole[kind], name, rng)
        try:
            found = self.read(kind, data)
        except ValueError as fault:  # FileFormatError and TopologyError are ValueErrors
            text = str(fault)
            return {"state": "refused" if len(text) > 15 else "UNCLEAR", "reason": text[:300]}
        except MemoryError:
            return {"state": "WRONG", "reason": "it asked for too much memory"}
        except BaseException as fault:
            return {"state": "WRONG", "reason": f"{type(fault).__name__}: {fault}"[:300]}
        same = found == self.sound[kind]
        return {"state": "same" if same else "other", "frames": len(found)}


def main() -> None:
    import resource
    import warnings

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        reader = Reader(Path(folder))
        for line in sys.stdin:
            print(json.dumps(reader(line.strip())), flush=True)


if __name__ == "__main__":
    main()
