"""The same foams by warpedfoam and by the Surface Evolver: energies, pressures and times, side by side.

    python benchmarks/against_evolver.py                 the table
    python benchmarks/against_evolver.py --bulging       the table of films free to bulge
    python benchmarks/against_evolver.py --formulas      the table of surfaces from formulas
    python benchmarks/against_evolver.py --record DIR    also the foams and the Evolver's answers, for tests

Needs the program ``evolver`` (Debian: evolver-nox). Each foam is relaxed by warpedfoam from Voronoi cells;
its films as 4, 8 and 16 chords then go to the Evolver, which solves from there by its own Newton steps. The
last two levels are extrapolated in chord length squared; the error of that is taken from the first two.

Surfaces from formulas are a landscape whose sides are joined, others that end in rims, a closed implicit one
and Schwarz's P. There are two levels, since volumes are long polynomials; what extrapolation adds is
given beside the difference that is left.

Films free to bulge go to the Evolver as its soapfilm model in quadratic elements, 4, 8 and 16 to a film
and 1, 2 and 4 from plate to plate. Where the lines meet the plates films have weak corners, so that the
order lies between 2 and 4: the last change of the Evolver's energy over 3 is an upper bound of its error.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

import warpedfoam as wf

SURFACES = {"sphere": wf.Sphere(1.0), "torus": wf.Torus(2.0, 1.0)}
SIZES, GAP, ORDER, SEED = (12, 50, 200), 0.1, 8, 0
LEVELS, STEPS = (4, 8, 16), 5
#: Surface, bubbles, seed, gap: small foams whose films bulge.
BULGING = (("sphere", 8, 1, 0.3), ("torus", 12, 15, 0.1), ("torus", 12, 15, 0.3))

K = "cos(pi*x/2)"
#: Surfaces from formulas, and bubbles.
FORMULAS = {
    "hills, joined": (lambda: wf.Graph.from_formula(f"0.2*{K}*sin(pi*y/2)", 4.0, 4.0, periodic=True), 14),
    "ridge, joined": (lambda: wf.Graph.from_formula(f"0.2*{K}", 4.0, 3.0, periodic=True), 12),
    "sheet, four sides": (lambda: wf.Graph.from_formula("0.1*x**2 - 0.15*y**2 + 0.05*x*y", 4.0, 3.0), 12),
    "bowl, round rim": (lambda: wf.Graph.from_formula("0.1*(x**2 + y**2)", 4.0, 4.0, disk=True), 12),
    "vase, two rims": (lambda: wf.Revolution.from_formula("(1 + 0.2*sin(2*z))**2", -1.0, 1.5), 14),
    "cup, a pole": (lambda: wf.Revolution.from_formula("1 - z**2/2", -(2.0**0.5), 0.7), 12),
    "implicit egg": (
        lambda: wf.Implicit.from_formula(
            "x**2 + y**2/1.44 + z**2/0.81 + 0.1*x*y*z - 1", [[-1.8] * 3, [1.8] * 3]
        ),
        16,
    ),
    "Schwarz P": (lambda: wf.SchwarzP(2.0), 64),
}


def evolved(path: Path, steps: int = STEPS, timeout: float = 300.0) -> tuple[wf.EvolverDump, float, bool]:
    """The Evolver's own solution of a datafile, its time, and whether it calls every Hessian positive."""
    dump = path.with_suffix(".dmp")
    # scale 0: the first step computes pressures and volumes and moves nothing downhill
    orders = ["m 0", "g 1", *["hessian"] * steps, f'dump "{dump}"', "q", "q", ""]
    start = time.perf_counter()
    done = subprocess.run(
        ["evolver", str(path)], input="\n".join(orders), text=True, capture_output=True, timeout=timeout
    )
    took = time.perf_counter() - start
    said = done.stdout + done.stderr
    energies = [float(e) for e in re.findall(r"energy:\s+([-\d.eE+]+)", said)]
    if not dump.exists() or len(energies) != steps + 1 or abs(energies[-1] / energies[-2] - 1.0) > 1e-11:
        raise RuntimeError(f"the Evolver did not converge: {said[-2000:]}")
    return wf.read_dmp(dump), took, "not positive" not in said


def extrapolated(values: list) -> list:
    """Richardson's values, the error's leading term being the chord length squared."""
    return [(4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(values)]


def compared(kind: str, count: int, folder: Path) -> tuple[dict[str, object], wf.Foam]:
    """One foam by both programs."""
    cell = wf.HeleShawCell(SURFACES[kind], GAP)
    raw = wf.voronoi_foam(cell, count, seeds="blue", seed=SEED)
    ours = {}
    for order in (4, ORDER):
        start = time.perf_counter()
        relaxed = wf.relax(raw, order=order)
        ours[order] = time.perf_counter() - start
    start = time.perf_counter()
    wf.relax(relaxed.foam, order=ORDER)
    again = time.perf_counter() - start
    foam = relaxed.foam
    assert relaxed.converged
    energies, pressures, times, positive = [], [], [], []
    for segments in LEVELS:
        path = wf.write_fe(folder / f"{kind}_{count}_{segments}.fe", foam, segments=segments)
        dump, took, minimum = evolved(path)
        energies.append(dump.energy)
        pressures.append(dump.bubble_pressures(foam))
        times.append(took)
        positive.append(minimum)
    row = {
        "surface": kind, "bubbles": count, "energy": foam.energy, "ours_s": ours, "again_s": again,
        "evolver_s": times, "energies": energies, "pressures": [p.tolist() for p in pressures],
        "minimum": positive,
    }  # fmt: skip
    return row, foam


def bulging(kind: str, count: int, seed: int, gap: float, folder: Path) -> tuple[dict[str, object], wf.Foam]:
    """One foam with films free to bulge by both programs."""
    cell = wf.HeleShawCell(SURFACES[kind], gap)
    start = time.perf_counter()
    ours = wf.relax(wf.voronoi_foam(cell, count, seed=seed, lloyd=2), order=12, layers=4)
    took = time.perf_counter() - start
    assert isinstance(ours, wf.LayeredRelaxation)
    assert ours.converged
    energies, pressures, times = [], [], []
    for k, segments in enumerate(LEVELS):
        path = folder / f"{kind}_{segments}.fe"
        wf.write_fe(path, ours.foam, model="soapfilm", segments=segments, layers=2**k)
        dump, seconds, _ = evolved(path, timeout=1500.0)
        energies.append(dump.energy)
        pressures.append(dump.bubble_pressures(ours.foam).tolist())
        times.append(seconds)
    row = {
        "surface": kind, "bubbles": count, "gap": gap, "ruled": ours.ruled_energy, "bulging": ours.energy,
        "energies": energies, "pressures": pressures,
    }  # fmt: skip
    saved = ours.ruled_energy - ours.energy
    limit = energies[-1] + (energies[-1] - energies[-2]) / 15.0
    print(
        f"| {kind} {count}, gap {gap:g} | {saved / ours.energy:.1e} "
        f"| {(ours.ruled_energy - limit) / ours.energy:.1e} | {abs(limit - ours.energy) / ours.energy:.1e} "
        f"| {abs(energies[-1] - energies[-2]) / 3.0 / ours.energy:.1e} "
        f"| {np.abs(np.array(pressures[-1]) - ours.pressures).max() / np.ptp(ours.pressures):.1e} "
        f"| {took:.1f} s | " + " | ".join(f"{t:.1f} s" for t in times) + " |",
        flush=True,
    )
    return row, ours.foam


def formula_table(only: str | None) -> None:
    """Energies and pressures on surfaces from formulas, by 4 and 8 chords a film."""
    print(
        "| foam | energy: 8 chords | extrapolated | added by that | pressures | added "
        "| we | Evolver: 4 | 8 chords |"
    )
    print("| --- " * 9 + "|")
    with tempfile.TemporaryDirectory() as name:
        for kind, (surface, count) in FORMULAS.items():
            if only is not None and only not in kind:
                continue
            raw = wf.voronoi_foam(wf.HeleShawCell(surface(), GAP), count, seed=2, lloyd=2)
            start = time.perf_counter()
            ours = wf.relax(raw, order=ORDER)
            took = time.perf_counter() - start
            energies, pressures, times = [], [], []
            for segments in LEVELS[:2]:
                path = wf.write_fe(Path(name) / f"{segments}.fe", ours.foam, segments=segments)
                dump, seconds, _ = evolved(path, timeout=900.0)
                energies.append(dump.energy)
                pressures.append(dump.bubble_pressures(ours.foam))
                times.append(seconds)
            limit, p = extrapolated(energies)[0], extrapolated(pressures)[0]
            spread = np.ptp(ours.pressures)
            added = abs(energies[1] - energies[0]) / 3.0 / ours.energy
            print(
                f"| {kind}, {count} | {abs(energies[1] / ours.energy - 1.0):.1e} "
                f"| {abs(limit / ours.energy - 1.0):.1e} | {added:.1e} "
                f"| {np.abs(p - ours.pressures).max() / spread:.1e} "
                f"| {np.abs(pressures[1] - pressures[0]).max() / 3.0 / spread:.1e} "
                f"| {took:.2f} s | {times[0]:.2f} s | {times[1]:.2f} s |",
                flush=True,
            )


def bulging_table(record: Path | None) -> None:
    """Saved by bulging, in both programs, and the times."""
    print(
        "| foam | saved, ours | saved, Evolver | difference | its error, at most | pressures "
        "| warpedfoam p = 12 | Evolver 4 × 1 | 8 × 2 | 16 × 4 |"
    )
    print("| --- " * 10 + "|")
    with tempfile.TemporaryDirectory() as name:
        for k, (kind, count, seed, gap) in enumerate(BULGING):
            row, foam = bulging(kind, count, seed, gap, Path(name))
            if record is not None:
                wf.save(record / f"bulging_{k}.npz", foam)
                (record / f"bulging_{k}.json").write_text(json.dumps(row) + "\n")


def errors(row: dict, pressures: np.ndarray) -> dict[str, float]:
    """Relative differences after extrapolation, and the extrapolation's own errors."""
    energy, p = extrapolated(row["energies"]), extrapolated([np.array(v) for v in row["pressures"]])
    spread = np.ptp(pressures)
    return {
        "energy_coarse": abs(row["energies"][-1] / row["energy"] - 1.0),
        "energy": abs(energy[-1] / row["energy"] - 1.0),
        "energy_error": abs(energy[-1] - energy[0]) / row["energy"],
        "pressure": float(np.abs(p[-1] - pressures).max() / spread),
        "pressure_error": float(np.abs(p[-1] - p[0]).max() / spread),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--record", type=Path, help="folder for foams and answers")
    parser.add_argument("--bulging", action="store_true", help="films free to bulge")
    parser.add_argument("--formulas", action="store_true", help="surfaces from formulas")
    parser.add_argument("--only", help="with --formulas: those whose name holds this")
    given = parser.parse_args()
    record = given.record
    if shutil.which("evolver") is None:
        raise SystemExit("the program evolver is not installed (Debian: apt-get install evolver-nox)")
    if given.formulas:
        formula_table(given.only)
        return
    if given.bulging:
        bulging_table(record)
        return
    print(
        "| foam | energy: 16 chords | extrapolated | its error | pressures | their error "
        "| warpedfoam p = 4 | p = 8 | again | Evolver 4 | 8 | 16 chords |"
    )
    print("| --- " * 12 + "|")
    with tempfile.TemporaryDirectory() as name:
        wf.relax(wf.voronoi_foam(wf.HeleShawCell(wf.Sphere(1.0), GAP), 20))  # warm up
        for count in SIZES:
            for kind in SURFACES:
                row, foam = compared(kind, count, Path(name))
                e = errors(row, foam.pressures)
                print(
                    f"| {kind} {count} | {e['energy_coarse']:.1e} | {e['energy']:.1e} "
                    f"| {e['energy_error']:.1e} | {e['pressure']:.1e} | {e['pressure_error']:.1e} "
                    f"| {row['ours_s'][4]:.2f} s "
                    f"| {row['ours_s'][ORDER]:.2f} s | {row['again_s']:.2f} s | "
                    + " | ".join(f"{t:.2f} s" for t in row["evolver_s"])
                    + " |",
                    flush=True,
                )
                if record is not None:
                    wf.save(record / f"{kind}_{count}.npz", foam)
                    kept = {k: row[k] for k in ("surface", "bubbles", "energies", "pressures", "minimum")}
                    (record / f"{kind}_{count}.json").write_text(json.dumps(kept) + "\n")
                    if (kind, count) == ("sphere", 12):
                        text = (Path(name) / "sphere_12_4.dmp").read_text()
                        (record / "sphere_12.dmp").write_text(text.replace(f"{name}/", ""))


if __name__ == "__main__":
    main()
