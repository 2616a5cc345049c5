"""Pictures and animations of drifts."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import warpedfoam as wf

from .test_motion import PAPER, one_bubble, sphere_grains
from .test_paper_figures import check_readable


@pytest.fixture(scope="module")
def moved() -> wf.Drift:
    return wf.drift(one_bubble(order=4), duration=500.0, every=100.0, tolerance=0.05)


def test_the_picture_shows_frames_and_energy(moved: wf.Drift, tmp_path: Path) -> None:
    figure = wf.plot_drift(moved, title="down")
    *pictures, energy = figure.axes
    assert len(pictures) == 4
    assert [axes.get_title() for axes in (pictures[0], pictures[-1])] == ["t = 0", "t = 500"]
    line = energy.lines[0].get_xydata()
    np.testing.assert_array_equal(line, np.stack([moved.step_times, moved.step_energies], axis=1))
    assert energy.get_xlabel() == "time"
    # a raw start falls far at once: what follows fills the picture, and the text tells the rest
    assert energy.get_ylim()[1] < moved.energies[0]
    assert f"{moved.energies[0]:.6g}" in energy.texts[0].get_text()
    # all frames show the same place
    assert len({axes.get_xlim() for axes in pictures}) == 1
    assert wf.save_figure(tmp_path / "drift.png", figure).stat().st_size > 10_000


def test_round_off_is_no_fall() -> None:
    """A raw start that stays where it is: its first fall is shown whole, and at rest the line is flat."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.01)
    raw = wf.cluster_foam(cell, 1, volumes=0.01)
    still = wf.drift(raw, duration=4.0, every=1.0)
    low, high = wf.plot_drift(still).axes[-1].get_ylim()
    assert low < still.step_energies[-1] < still.step_energies[0] < high
    rest = wf.drift(still.foam, duration=4.0, every=1.0)
    low, high = wf.plot_drift(rest).axes[-1].get_ylim()
    assert (high - low) / abs(high) == pytest.approx(2e-7, rel=1e-3)


def test_a_drift_on_a_column(moved: wf.Drift) -> None:
    figure = wf.plot_drift(moved, width=86.0, title="down")
    check_readable(figure, 86.0)
    boxes = [axes.get_window_extent() for axes in figure.axes[:4]]
    # two by two
    assert len({round(0.5 * (box.x0 + box.x1)) for box in boxes}) == 2
    assert len({round(0.5 * (box.y0 + box.y1)) for box in boxes}) == 2
    with pytest.raises(ValueError, match="size must be at least 1 inch"):
        wf.plot_drift(moved, size=(0.1, 3.0))


def test_the_view_sees_every_bubble(moved: wf.Drift) -> None:
    from warpedfoam.plot.painting import cluster_view
    from warpedfoam.plot.projection import View

    view = cluster_view(moved.foams)
    assert view is not None
    depth = View.from_angles(*view).project(PAPER.normals(moved.centres[:, 0]))[:, 2]
    assert depth.min() > 0.1
    assert cluster_view([sphere_grains()]) is None


def test_frames_can_be_chosen(moved: wf.Drift) -> None:
    assert len(wf.plot_drift(moved, frames=[0, -1], color_by="sides", view=(30.0, 10.0)).axes) == 3
    for frames, words in (([], "1 to 8 frames"), ([99], "frames must be at most"), (range(9), "1 to 8")):
        with pytest.raises(ValueError, match=words):
            wf.plot_drift(moved, frames=frames)
    with pytest.raises(TypeError, match="drift must be a Drift"):
        wf.plot_drift("drift")  # type: ignore[arg-type]


def test_gif(moved: wf.Drift, tmp_path: Path) -> None:
    short = replace(moved, foams=moved.foams[:3], times=moved.times[:3])
    path = wf.animate(short, tmp_path / "drift.gif", frames_per_second=20.0, size=(3.0, 3.0), dpi=50)
    with Image.open(path) as image:
        assert (image.n_frames, image.size, image.info["duration"]) == (3, (150, 150), 50)
        first = np.asarray(image.convert("RGB"), dtype=int)
        image.seek(2)
        assert np.abs(np.asarray(image.convert("RGB"), dtype=int) - first).max() > 50
    assert [p.name for p in tmp_path.iterdir()] == ["drift.gif"]


def test_a_trajectory_can_be_animated(tmp_path: Path) -> None:
    with wf.TrajectoryWriter(tmp_path / "run.h5") as writer:
        for _ in range(2):
            writer.append(sphere_grains())
    path = wf.animate(tmp_path / "run.h5", tmp_path / "a.gif", size=(2.0, 2.0), dpi=40)
    with Image.open(path) as image:
        assert image.n_frames == 2


def test_mp4_needs_ffmpeg(moved: wf.Drift, tmp_path: Path) -> None:
    target = tmp_path / "drift.mp4"
    short = replace(moved, foams=moved.foams[:2], times=moved.times[:2])
    if shutil.which("ffmpeg") is None:
        with pytest.raises(RuntimeError, match="needs the program ffmpeg"):
            wf.animate(short, target)
        assert not list(tmp_path.iterdir())
    else:
        assert wf.animate(short, target, size=(2.0, 2.0), dpi=50).stat().st_size > 500


def test_other_endings_are_refused(moved: wf.Drift, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must end in"):
        wf.animate(moved, tmp_path / "drift.avi")
    with pytest.raises(ValueError, match="frames_per_second must be at least"):
        wf.animate(moved, tmp_path / "drift.gif", frames_per_second=0.0)
