"""Time of one picture of the viewer in a headless browser, and what its file weighs.

Graphics are computed by the processor (SwiftShader), so this is a floor: any graphics card is faster.
Beside the time on the clock stands the processor time of the browser's processes, which other work on the
machine does not lengthen. "script" is what the page itself does for a picture, with a graphics library that
does nothing: all that is left of the processor's work where there is a graphics card. "frame" is what it does
to go on to another frame of a trajectory: unpack it and hand it over.

    PYTHONPATH=src:. python benchmarks/view_frames.py [bubbles ...]
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from tests.browser import Browser
from tests.io_foams import sphere_foam

import warpedfoam as wf

TICK = 1.0 / os.sysconf("SC_CLK_TCK")


def processor_time(pid: int) -> float:
    """Seconds of a process and all its children (Linux)."""
    parents: dict[int, list[int]] = {}
    used: dict[int, float] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
        except (OSError, IndexError):
            continue
        parents.setdefault(int(fields[1]), []).append(int(folder.name))
        used[int(folder.name)] = TICK * (int(fields[11]) + int(fields[12]))
    total, todo = 0.0, [pid]
    while todo:
        one = todo.pop()
        total += used.get(one, 0.0)
        todo += parents.get(one, [])
    return total


def main(counts: list[int]) -> None:
    """Print one line a foam."""
    print(
        "bubbles  window    file/MB  write/s  open/s  ms a picture (median)  processor ms a picture  "
        "script us  frame ms"
    )
    browser = Browser()
    try:
        with tempfile.TemporaryDirectory() as folder:
            for count in counts:
                foam = sphere_foam(count, even=True)
                began = time.perf_counter()
                path = wf.write_view(Path(folder) / "view.html", foam)
                wrote = time.perf_counter() - began
                for name, size, zoom in (
                    ("desktop", (1200, 800, 1.0, False), 0),
                    ("desktop*", (1200, 800, 1.0, False), 6),
                    ("phone", (390, 780, 2.0, True), 0),
                ):
                    browser.window(size[0], size[1], dots=size[2], phone=size[3])
                    began = time.perf_counter()
                    browser.open(path)
                    opened = time.perf_counter() - began
                    for _ in range(zoom):
                        browser.wheel((450.0, 400.0), -200.0)
                    browser.ask("foamViewer.time(3)")
                    before = processor_time(browser.pid)
                    times = browser.ask("foamViewer.time(20)")
                    used = 1e3 * (processor_time(browser.pid) - before) / len(times)
                    cost = browser.ask("foamViewer.cost()")
                    print(
                        f"{count:7d}  {name:8s}  {path.stat().st_size / 1e6:7.2f}  {wrote:7.2f}  "
                        f"{opened:6.2f}  {np.median(times):21.1f}  {used:22.1f}  "
                        f"{1e3 * cost['picture']:9.0f}  {cost['frame']:8.1f}"
                    )
    finally:
        browser.close()
    print("desktop*: zoomed in seven times, where bubbles are drawn in all detail")


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [200, 2000, 10_000])
