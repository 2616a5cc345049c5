"""Seconds that ``import warpedfoam`` takes in fresh interpreters, and which modules take them.

    python benchmarks/import_time.py

Medians; the bare interpreter is measured too. The import alone waits for what is asked for, so one that asks
for all names is measured with it, and the command's help. One import before the clock starts compiles the
bytecode.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time

ALL = "from warpedfoam import *"
CODES = ("pass", "import warpedfoam", "import warpedfoam as wf; wf.relax, wf.voronoi_foam, wf.Torus", ALL)
HELP = "import sys; sys.argv[1:] = ['--help']; from warpedfoam.cli import main; main()"


def seconds(code: str) -> float:
    """Wall time of a fresh interpreter that runs ``code``."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - start


def modules(code: str) -> list[tuple[float, float, str]]:
    """All modules by own time from ``-X importtime``: (own ms, with all it imports ms, name)."""
    command = [sys.executable, "-X", "importtime", "-c", code]
    report = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    rows = []
    for line in report.splitlines():
        own, _, rest = line.removeprefix("import time:").partition("|")
        total, _, name = rest.partition("|")
        if own.strip().isdigit():
            rows.append((int(own) / 1e3, int(total) / 1e3, name.strip()))
    return sorted(rows, reverse=True)


def packages(rows: list[tuple[float, float, str]]) -> list[tuple[float, str]]:
    """Own times summed by package, the standard library as one."""
    sums: dict[str, float] = {}
    for own, _, name in rows:
        top = name.partition(".")[0]
        key = "(standard library)" if top in sys.stdlib_module_names else top
        sums[key] = sums.get(key, 0.0) + own
    return sorted(((own, name) for name, own in sums.items()), reverse=True)


def main() -> int:
    """Print the medians and the heaviest modules; 1 if importing all takes longer than the limit."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--modules", type=int, default=10, help="how many of the heaviest modules to list")
    parser.add_argument("--limit", type=float, default=1.0, help="seconds wanted at most")
    args = parser.parse_args()
    seconds(ALL)
    whole = {}
    for code in (*CODES, HELP):
        times = [seconds(code) for _ in range(args.repeats)]
        whole[code] = statistics.median(times)
        name = "warpedfoam --help" if code == HELP else code
        print(f"{whole[code]:.3f} s ({min(times):.3f} to {max(times):.3f})  {name}")
    rows = modules(ALL)
    print("\n  own/ms  with imports/ms  module")
    for own, total, name in rows[: args.modules]:
        print(f"{own:8.1f} {total:16.1f}  {name}")
    print("\n  own/ms  package")
    for own, name in packages(rows)[: args.modules]:
        print(f"{own:8.1f}  {name}")
    return 0 if whole[ALL] <= args.limit else 1


if __name__ == "__main__":
    sys.exit(main())
