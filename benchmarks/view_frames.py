"""Time of one picture of the viewer in a headless browser, at rest and moving, and what its file weighs.

Graphics are computed by the processor (SwiftShader) on one core, so this is a floor: any graphics card is
faster. Beside the time on the clock stands the processor time of the browser's processes, which other work
on the machine does not lengthen. "triangles" are those of bubbles and films that are sent to be drawn.
"script" is what the page itself does for a picture, with a graphics library that does nothing: all that is
left of the processor's work where there is a graphics card. "frame" is what it does to go on to another
frame of a trajectory: unpack it and hand it over.

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

# Windows whose pictures are 900 x 694 dots, and of a phone; zooming by so many turns of the wheel.
WINDOWS = (
    ("desktop", (1204, 746, 1.0, False), 0),
    ("desktop*", (1204, 746, 1.0, False), 6),
    ("phone", (390, 844, 3.0, True), 0),
)
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


def one_core(pid: int) -> None:
    """Keep a process and its threads, and those they start, on the last core (Linux)."""
    for task in Path(f"/proc/{pid}/task").iterdir():
        os.sched_setaffinity(int(task.name), {max(os.sched_getaffinity(0))})


def measured(browser: Browser, moving: bool) -> tuple[float, float, int]:
    """Milliseconds a picture (median), the processor's (mean), and triangles."""
    word = "true" if moving else "false"
    browser.ask(f"foamViewer.time(4, {word})")
    before = processor_time(browser.pid)
    times = browser.ask(f"foamViewer.time(30, {word})")
    used = 1e3 * (processor_time(browser.pid) - before) / len(times)
    drawn = browser.ask("foamViewer.drawn()")
    return float(np.median(times)), used, drawn["triangles"] + drawn["films"]


def main(counts: list[int]) -> None:
    """Print two lines a foam and window."""
    print("load of the machine before: " + " ".join(f"{x:.1f}" for x in os.getloadavg()))
    print(
        "bubbles  window    file/MB  write/s  open/s  picture  triangles  ms (median)  processor ms  "
        "script us  frame ms"
    )
    with tempfile.TemporaryDirectory() as folder:
        for count in counts:
            foam = sphere_foam(count, even=True)
            began = time.perf_counter()
            path = wf.write_view(Path(folder) / "view.html", foam)
            wrote = time.perf_counter() - began
            for name, size, zoom in WINDOWS:
                browser = Browser()
                try:
                    one_core(browser.pid)
                    browser.window(size[0], size[1], dots=size[2], phone=size[3])
                    began = time.perf_counter()
                    browser.open(path)
                    opened = time.perf_counter() - began
                    for _ in range(zoom):
                        browser.wheel((450.0, 400.0), -200.0)
                    browser.ask("new Promise((r) => setTimeout(r, 400))")
                    still, moving = measured(browser, False), measured(browser, True)
                    cost = browser.ask("foamViewer.cost()")
                finally:
                    browser.close()
                for word, (clock, used, triangles) in (("rest", still), ("moving", moving)):
                    print(
                        f"{count:7d}  {name:8s}  {path.stat().st_size / 1e6:7.2f}  {wrote:7.2f}  "
                        f"{opened:6.2f}  {word:7s}  {triangles:9d}  {clock:11.1f}  {used:12.1f}  "
                        f"{1e3 * cost['picture']:9.0f}  {cost['frame']:8.1f}",
                        flush=True,
                    )
    print("desktop*: after six turns of the wheel, where bubbles are drawn in all detail")
    print("load of the machine after: " + " ".join(f"{x:.1f}" for x in os.getloadavg()))


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [200, 2000, 10_000])
