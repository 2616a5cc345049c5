"""What the benchmarks share: cells, starting points, counts on a command line, small statistics."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

import warpedfoam as wf


def cell_of(surface: str, nudge: int = 0) -> wf.HeleShawCell:
    """The standard cells: Torus(20, 4) with gap 0.5, unit sphere with gap 0.01.

    ``nudge`` changes the size by that many parts in 10¹⁰, so that no mesh comes from a cache.
    """
    size = 1.0 + 1e-10 * nudge
    if surface == "torus":
        return wf.HeleShawCell(wf.Torus(20.0 * size, 4.0 * size), gap=0.5)
    return wf.HeleShawCell(wf.Sphere(size), gap=0.01)


def whole_numbers(text: str) -> list[int]:
    """Integers from "3", "0-9" or "0,2,5-7"."""
    out: list[int] = []
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            out += range(int(first), int(last or first) + 1)
    except ValueError:
        raise argparse.ArgumentTypeError(f"wanted integers such as 3, 0-9 or 0,2,5-7; got {text!r}") from None
    return out


def one_core(core: int | None = None) -> None:
    """Keep this process on one of the processor's cores, the last by default, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0)) if core is None else core})


def over_bound(foam: wf.Foam) -> float:
    """Film length on the inner plate over that of a flat honeycomb of as many cells of equal area."""
    honeycomb = 12.0**0.25 * np.sqrt(foam.cell.surface.area * foam.n_bubbles)
    return float(foam.film_lengths.sum()) / float(honeycomb)


def exponent(sizes: list[int], seconds: list[float]) -> float:
    """Slope of log(seconds) over log(sizes), least squares; NaN from fewer than two sizes."""
    if len(set(sizes)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


class ExclusiveTimers:
    """Seconds spent under each name; time spent under a nested name is not counted twice."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self._stack: list[str] = []
        self._last = 0.0

    @contextmanager
    def under(self, name: str) -> Iterator[None]:
        """Book the time inside under ``name``."""
        self._book()
        self._stack.append(name)
        self.calls[name] = self.calls.get(name, 0) + 1
        try:
            yield
        finally:
            self._book()
            self._stack.pop()

    def _book(self) -> None:
        now = time.perf_counter()
        if self._stack:
            name = self._stack[-1]
            self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now
