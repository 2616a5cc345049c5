"""Mutated meshes and scrambled mesh files, and the worker process that takes them to a relaxed foam.

Run as a module (``python -m tests.mutated_meshes``) it reads names of cases, one a line, and answers
each with one line of JSON.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tests.mesh_mutations import MUTATIONS, SOUND, base
from tests.scrambled_files import ENDINGS, FORMATS, JUNK, SCRAMBLES

if TYPE_CHECKING:
    from warpedfoam.surfaces import TriangleMesh

GAP_SHARE, N_BUBBLES, ORDER, STEPS = 0.01, 60, 2, 80
#: Nodes of the meshes that carry integrals and distances: fewer than by default, to be quick.
INTEGRAL_NODES, FOAM_NODES = 300, 900
#: Half of the cases go through the compiled loops, as if their meshes had the nodes that call for them.
COMPILED = 50
MEMORY = 4 << 30

# ---------------------------------------------------------------------------- cases


#: What the tests of the worker itself ask for.
STOPS: dict[str, Callable[[], object]] = {
    "stop/crash": lambda: os.kill(os.getpid(), 11),
    "stop/hang": lambda: time.sleep(1000),
    "stop/memory": lambda: np.ones(2 * MEMORY, dtype=np.uint8),
}


def all_cases() -> list[str]:
    """Names of all cases; a name says everything about its case."""
    bases, formats = ("sphere", "ellipsoid", "torus"), tuple(FORMATS)
    out, turn = [], 0
    for name, (_, seeds) in MUTATIONS.items():
        for seed in range(seeds):
            # formats that share nodes: in the others each triangle would have corners of its own
            shape = "torus" if name == "spindle" else "sphere" if name in SOUND else bases[turn % 3]
            out.append(f"mesh/{name}/{shape}/{formats[turn % 4 if turn % 5 else turn % 6]}/{seed}")
            turn += 1
    for kind in formats:
        for name, (_, seeds) in SCRAMBLES.items():
            for seed in range(seeds):
                out.append(f"file/{name}/{bases[turn % 2]}/{kind}/{seed}")
                turn += 1
        for ending in (e for e in ENDINGS if e != FORMATS[kind][0]):
            out.append(f"ending/{ending}/sphere/{kind}/0")
    out += [f"junk/{name}/none/{ending}/0" for name in JUNK for ending in ENDINGS]
    return out


def case_file(case: str) -> tuple[str, bytes]:
    """Ending and content of a case's file."""
    sort, name, shape, kind, seed = case.split("/")
    rng = np.random.default_rng([int(seed), *case.encode()])
    if sort == "junk":
        return kind, JUNK[name](rng)
    ending, write = FORMATS[kind]
    nodes, triangles = base(shape)
    if sort == "mesh":
        return ending, write(*MUTATIONS[name][0](nodes, triangles, rng))
    data = write(nodes, triangles)
    if sort == "ending":
        return name, data
    return ending, SCRAMBLES[name][0](data, rng, kind)


# ---------------------------------------------------------------------------- the worker


def outcome(case: str, folder: Path, known: dict[bytes, dict[str, object]]) -> dict[str, object]:
    """What becomes of a case: ``state`` is refused, converged, not converged, or WRONG with a reason.

    Files that hold a mesh seen before, to six digits, need not be taken to a foam again: ``known`` has
    the answer.
    """
    from warpedfoam.errors import WarpedFoamError
    from warpedfoam.surfaces import read_mesh

    if case in STOPS:
        STOPS[case]()
    ending, data = case_file(case)
    path = folder / f"mesh{ending}"
    path.write_bytes(data)
    stages = ["read"]
    try:
        mesh = read_mesh(path)
        key = " ".join(f"{x:.6g}" for x in mesh.nodes.ravel()).encode() + mesh.triangles.tobytes()
        if key not in known:
            known[key] = foam_of(mesh, stages)
        return known[key]
    except (ValueError, TypeError, OSError, WarpedFoamError) as fault:
        if len(str(fault)) < 20 or stages[-1] == "report":
            return {"state": "WRONG", "reason": f"unclear, or not for {stages[-1]} to raise: {fault!r}"}
        return {"state": "refused", "stage": stages[-1], "reason": str(fault)}


def foam_of(mesh: TriangleMesh, stages: list[str]) -> dict[str, object]:
    """The outcome of a mesh that could be read; ``stages`` is told how far it comes."""
    from warpedfoam import HeleShawCell, MeshSurface, relax, voronoi_foam
    from warpedfoam.errors import MeshError
    from warpedfoam.surfaces import mesh_report

    stages.append("report")
    report = mesh_report(mesh)
    stages.append("surface")
    try:
        surface = MeshSurface(mesh.nodes, mesh.triangles)
    except MeshError as fault:
        if report.sound:
            return {"state": "WRONG", "reason": f"the report finds it sound, the surface refuses: {fault}"}
        raise
    if not report.sound:
        return {"state": "WRONG", "reason": f"the surface accepts, the report finds {report.findings}"}
    stages.append("cell")
    cell = HeleShawCell(surface, gap=GAP_SHARE * float(np.ptp(mesh.nodes, axis=0).max()))
    stages.append("foam")
    foam = voronoi_foam(cell, N_BUBBLES, seeds="blue", seed=1, n_nodes=FOAM_NODES, order=ORDER)
    stages.append("relax")
    relaxed = relax(foam, max_iterations=STEPS)
    chi, charges = mesh.euler_characteristic, int(relaxed.foam.network.charges.sum())
    area = surface.area / mesh.area
    volumes = relaxed.foam.bubble_volumes.sum() / cell.volume
    facts = {"area": area, "reason": relaxed.message, "notes": [f.fault for f in report.findings]}
    if charges != 6 * chi:
        return {**facts, "state": "WRONG", "reason": f"charges add to {charges}, χ is {chi}"}
    if not 0.9 < area < 1.1:
        return {**facts, "state": "WRONG", "reason": f"the smooth surface has {area:.3g} times the area"}
    if relaxed.converged and not abs(volumes - 1.0) < 1e-3:
        return {**facts, "state": "WRONG", "reason": f"the volumes add up to {volumes} of the cell's"}
    return {**facts, "state": "converged" if relaxed.converged else "not converged"}


def main() -> None:
    """Answer cases until the input ends."""
    import faulthandler

    faulthandler.enable()
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    except ImportError:  # not on Windows
        pass
    import warnings

    from warpedfoam.kernels import jets
    from warpedfoam.surfaces.level import LevelSurface

    many = jets.MANY
    LevelSurface.integral_nodes = INTEGRAL_NODES
    warnings.simplefilter("error")
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever libraries print must not come between the answers
    known: dict[bytes, dict[str, object]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for line in sys.stdin:
            start = time.perf_counter()
            jets.MANY = COMPILED if zlib.crc32(line.strip().encode()) % 2 else many
            try:
                result = outcome(line.strip(), Path(folder), known)
            except Exception as fault:
                result = {"state": "WRONG", "reason": f"unexpected {fault!r}", "trace": _last_lines(fault)}
            result = {**result, "seconds": time.perf_counter() - start}
            print(json.dumps(result), file=answers, flush=True)


def _last_lines(fault: BaseException) -> str:
    import traceback

    return "".join(traceback.format_exception(fault)[-4:])


if __name__ == "__main__":
    main()
