"""Pictures of a drift: frames with the energy against time, and animations."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Floats, as_instance, as_integer, as_number
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, as_path, atomic_binary, writable_path
from warpedfoam.io.colours import bubble_colours
from warpedfoam.io.patches import bubble_patches
from warpedfoam.io.trajectory import Trajectory
from warpedfoam.motion.result import Drift
from warpedfoam.plot.painting import as_pair, cluster_view, default_view, paint_foam, resolution
from warpedfoam.plot.projection import View
from warpedfoam.plot.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Endings of animations, and the most frames of one.
ENDINGS, MOST_FRAMES = (".gif", ".mp4"), 2000
#: Room round the bubbles in a close view, as a share of them; all is shown from a share of the whole on.
MARGIN, WHOLE = 0.15, 0.7
#: A first fall so many times as great as all that follows is cut off.
STEEP = 3.0
#: Energies that differ by less than this share are the same to a reader.
STILL = 1e-7
#: Frames in the picture of a drift whose choice is left to it.
SHOWN = 4

Colours = NDArray[np.uint8]


def plot_drift(
    drift: Drift,
    *,
    frames: Sequence[int] | None = None,
    color_by: str = "charge",
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (10.0, 6.4),
    width: float | None = None,
    title: str | None = None,
) -> Figure:
    """Draw some frames of a drift over its energy against time; T1s are marked on the line.

    Parameters
    ----------
    drift : Drift
    frames : sequence of int, optional
        Which frames, at most 8; by default four, evenly spread over the way that the bubbles go.
    color_by : {"charge", "pressure", "sides", "area"}, optional
    view : (float, float), optional
        Elevation and azimuth in degrees; by default from where the bubbles of clusters are seen best.
    size : (float, float), optional
        Width and height in inches.
    width : float, optional
        Instead, the width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.
    title : str, optional

    Returns
    -------
    matplotlib.figure.Figure
        Not tied to pyplot: nothing to close.

    Raises
    ------
    TypeError, ValueError
        If ``drift`` is not a Drift, a frame is not there, or an option is unknown.
    """
    as_instance(drift, "drift", Drift)
    chosen = _spread(drift) if frames is None else [int(k) for k in frames]
    if not 1 <= len(chosen) <= 8:
        raise ValueError(f"frames must name 1 to 8 frames, got {len(chosen)}")
    last = len(drift.foams) - 1
    for k in chosen:
        as_integer(k, "frames", minimum=-last - 1, maximum=last)
    shown = [drift.foams[k] for k in chosen]
    stage = _Stage(drift.foams, view)
    wide, high = as_pair(size, "size")
    if min(wide, high) < 1.0:
        raise ValueError(f"size must be at least 1 inch each way, got {wide:g} by {high:g}")
    if width is None:
        style = replace(Style.of(None, float(np.clip(25.4 * wide, 40.0, 1000.0))), width=wide, narrow=False)
    else:
        style = Style.of(width)
    columns = min(len(shown), 2) if style.narrow else len(shown)
    rows = -(-len(shown) // columns)
    picture, chart = style.width / columns + style.rise, 0.62 * style.width
    with style.context():
        if style.narrow:
            figure, heights = style.figure(rows * picture + chart), (*[picture] * rows, chart)
        else:
            figure, heights = style.figure(high * style.width / wide), (1.5, 1.0)
        if title is not None:
            figure.suptitle(title, fontsize=style.title)
        grid = figure.add_gridspec(rows + 1, columns, height_ratios=heights)
        for place, (k, foam) in enumerate(zip(chosen, shown, strict=True)):
            axes = figure.add_subplot(grid[place // columns, place % columns])
            stage.paint(axes, foam, color_by)
            axes.set_title(f"t = {drift.times[k]:.4g}", fontsize=style.text)
        axes = figure.add_subplot(grid[rows, :])
        _energy_axes(axes, drift, style)
        at = drift.times[chosen], drift.energies[chosen]
        axes.plot(*at, "o", color="0.15", ms=4.0 * style.line, zorder=3)
    return figure


def animate(
    trajectory: Drift | Trajectory | PathLike,
    path: PathLike,
    *,
    color_by: str = "charge",
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (6.4, 6.0),
    frames_per_second: float = 12.0,
    dpi: int = 90,
) -> Path:
    """Write a drift as an animation: the foam over its energy against time.

    Parameters
    ----------
    trajectory : Drift, Trajectory or path
        Or any HDF5 trajectory of foams in one cell.
    path : str or path
        ``.gif``, or ``.mp4`` where the program ffmpeg is installed.
    color_by, view, size
        As in `plot_drift`.
    frames_per_second : float, optional
    dpi : int, optional

    Returns
    -------
    pathlib.Path
        The file written; it appears whole or not at all.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, or the file's ending is another one.
    RuntimeError
        If ``path`` ends in ``.mp4`` and there is no ffmpeg.
    FileNotFoundError, IsADirectoryError, FileFormatError
        If a file cannot be read or written.
    """
    target = writable_path(path, suffixes=ENDINGS)
    rate = as_number(frames_per_second, "frames_per_second", minimum=0.1, maximum=100.0)
    dots = as_integer(dpi, "dpi", minimum=20, maximum=600)
    if target.suffix.lower() == ".mp4":
        from matplotlib.animation import FFMpegWriter

        if not FFMpegWriter.isAvailable():
            raise RuntimeError(
                f"cannot write {target}: MP4 needs the program ffmpeg, which is not installed; write a .gif"
            )
    if isinstance(trajectory, Drift):
        foams, times, energies = list(trajectory.foams), trajectory.times, trajectory.energies
    else:
        opened = trajectory if isinstance(trajectory, Trajectory) else Trajectory(as_path(trajectory))
        try:
            foams, times = list(opened), opened.times
        finally:
            if opened is not trajectory:
                opened.close()
        energies = np.array([foam.energy for foam in foams])
    if not 1 <= len(foams) <= MOST_FRAMES:
        raise ValueError(f"trajectory must hold 1 to {MOST_FRAMES} frames, got {len(foams)}")
    pictures = _pictures(foams, times, energies, color_by, view, as_pair(size, "size"), dots)
    if target.suffix.lower() == ".gif":
        _write_gif(target, pictures, rate)
    else:
        _write_mp4(target, pictures, rate)
    return target


def _pictures(
    foams: list[Foam],
    times: Floats,
    energies: Floats,
    color_by: str,
    view: tuple[float, float] | None,
    size: tuple[float, float],
    dots: int,
) -> Iterator[Colours]:
    """Frame after frame as (height, width, 3) bytes, both sides even."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    stage = _Stage(foams, view)
    for foam, time, energy in zip(foams, times, energies, strict=True):
        figure = Figure(figsize=size, dpi=dots, layout="constrained")
        canvas: Any = FigureCanvasAgg(figure)
        above, below = figure.subplots(2, 1, height_ratios=(3.0, 1.0))
        stage.paint(above, foam, color_by)
        above.set_title(f"t = {time:.4g}", fontsize=10)
        below.plot(times, energies, color="0.6", lw=1.2)
        below.plot([time], [energy], "o", color="#cc3d28", ms=5)
        _label(below, energies)
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())[:, :, :3]
        yield pixels[: pixels.shape[0] // 2 * 2, : pixels.shape[1] // 2 * 2].copy()


def _write_gif(target: Path, pictures: Iterator[Colours], rate: float) -> None:
    from PIL import Image

    images = [Image.fromarray(p).quantize(colors=128, dither=Image.Dither.NONE) for p in pictures]
    with atomic_binary(target) as stream:
        images[0].save(
            stream,
            format="GIF",
            save_all=True,
            append_images=images[1:],
            duration=max(10, round(1000.0 / rate)),
            loop=0,
        )


def _write_mp4(target: Path, pictures: Iterator[Colours], rate: float) -> None:
    import subprocess

    first = next(pictures)
    height, width = first.shape[:2]
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(6)}.mp4")
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{rate:g}", "-i", "-", "-pix_fmt", "yuv420p"]
    try:
        with subprocess.Popen([*command, str(temporary)], stdin=subprocess.PIPE) as process:
            assert process.stdin is not None
            process.stdin.write(first.tobytes())
            for picture in pictures:
                process.stdin.write(picture.tobytes())
            process.stdin.close()
            if process.wait() != 0:
                raise RuntimeError(f"cannot write {target}: ffmpeg ended with code {process.returncode}")
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


class _Stage:
    """The same view and the same cut-out for all frames."""

    def __init__(self, foams: Sequence[Foam], view: tuple[float, float] | None) -> None:
        first = foams[0]
        segments, rings = resolution(first.n_bubbles)
        self._segments, self._rings = segments, rings
        patches = bubble_patches(first, curve_points=segments + 1, rings=rings)
        if view is None:
            elevation, azimuth = cluster_view(foams) or default_view(first, patches)
        else:
            elevation, azimuth = as_pair(view, "view")
        self._view = View.from_angles(elevation, azimuth)
        flat = self._view.project(patches.points)[:, :2]
        low, high = flat.min(axis=0), flat.max(axis=0)
        whole = float((high - low).max())
        self._box: tuple[Floats, Floats] | None = None
        if first.exterior is not None:
            curves = [self._view.project(foam.film_curves(8))[..., :2].reshape(-1, 2) for foam in foams]
            places = np.concatenate(curves)
            near, far = places.min(axis=0), places.max(axis=0)
            half = (0.5 + MARGIN) * float((far - near).max())
            if 2.0 * half < WHOLE * whole:
                self._box = (0.5 * (near + far) - half, 0.5 * (near + far) + half)

    def paint(self, axes: Axes, foam: Foam, color_by: str) -> None:
        """Draw a foam, cut out like all others."""
        axes.set_aspect("equal")
        axes.set_axis_off()
        patches = bubble_patches(foam, curve_points=self._segments + 1, rings=self._rings)
        paint_foam(axes, foam, patches, bubble_colours(foam, color_by), self._view, self._segments, None)
        if self._box is not None:
            low, high = self._box
            axes.set_xlim(low[0], high[0])
            axes.set_ylim(low[1], high[1])


def _spread(drift: Drift) -> list[int]:
    """Frames evenly spread over the way that the bubbles go."""
    count = len(drift.foams)
    if count <= SHOWN:
        return list(range(count))
    moves = np.linalg.norm(np.diff(drift.centres, axis=0), axis=2).mean(axis=1)
    way = np.concatenate([[0.0], np.cumsum(moves)])
    if not way[-1] > 0.0:
        return [0, count - 1]
    wanted = np.linspace(0.0, way[-1], SHOWN)
    found = {int(np.abs(way - w).argmin()) for w in wanted[:-1]}
    return sorted({0, *found, count - 1})


def _energy_axes(axes: Axes, drift: Drift, style: Style) -> None:
    axes.plot(drift.step_times, drift.step_energies, color="#2f78bd", lw=1.4 * style.line)
    if drift.events:
        axes.plot(
            [e.time for e in drift.events],
            [e.energy_after for e in drift.events],
            "|",
            color="#cc3d28",
            ms=12 * style.line,
            label="T1",
        )
        axes.legend(frameon=False)
    _label(axes, drift.energies, style.small)


def _label(axes: Any, energies: Floats, small: float = 9.0) -> None:
    """Names of the axes; the fall in which a raw start finds its shape is cut off, and said so."""
    middle = 0.5 * float(energies.max() + energies.min())
    if float(np.ptp(energies)) < STILL * abs(middle):
        # at rest: not a mountain of round-off
        axes.set_ylim(middle * (1.0 - STILL), middle * (1.0 + STILL))
    if len(energies) > 3:
        low, high = float(energies.min()), float(energies[1:].max())
        # what is left must be more than round-off
        if energies[0] - high > STEEP * (high - low) > STEEP * STILL * abs(high):
            room = 0.1 * (high - low)
            axes.set_ylim(low - room, high + room)
            axes.annotate(
                f"from {energies[0]:.6g} at first", (0.02, 0.9), xycoords="axes fraction", fontsize=small
            )
    axes.set_xlabel("time")
    axes.set_ylabel("energy")
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
