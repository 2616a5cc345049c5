"""One choice of colours: told apart by colour-blind readers, the same in pictures, files and the viewer."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from warpedfoam.io.colours import (
    CHARGE_RANGE,
    FILM_COLOUR,
    OUTSIDE_COLOUR,
    as_rgb,
    bubble_colours,
    charge_rgb,
    diverging_rgb,
    ramp_rgb,
)
from warpedfoam.plot import plot_defects, plot_foam, plot_histogram, plot_map
from warpedfoam.plot.defect_picture import OUTLINES
from warpedfoam.plot.histories import _CURVES
from warpedfoam.view.scalars import bubble_scalars

from .colour_vision import DEFICIENCIES, ciede2000, lab
from .io_foams import bubble_on_torus, lone_bubble, sphere_foam, torus_foam, with_pressures

#: Least ΔE00 of neighbouring charges (1 is just seen side by side), of outlines, of a charge and a film.
CHARGES_APART, OUTLINES_APART, FILMS_APART = 12.0, 7.0, 12.0


def least(rgb: np.ndarray, deficiency: str) -> float:
    seen = lab(rgb, deficiency)
    return min(float(ciede2000(seen[[i]], seen[[j]])[0]) for i, j in combinations(range(len(seen)), 2))


def test_the_measure_itself() -> None:
    """Pairs from Sharma, Wu and Dalal's table, and two that a deuteranope confuses."""
    first = np.array([[50, 2.6772, -79.7751], [50, 2.5, 0.0], [50, 2.49, -0.001], [2.0776, 0.0795, -1.135]])
    second = np.array([[50, 0, -82.7485], [73, 25, -18], [50, -2.49, 0.0009], [0.9033, -0.0636, -0.5514]])
    np.testing.assert_allclose(ciede2000(first, second), [2.0425, 27.1492, 7.1792, 0.9082], atol=1e-4)
    red_and_green = np.array([[160, 110, 40], [110, 128, 40]])
    assert least(red_and_green, "none") > 15.0
    assert least(red_and_green, "deuteranopia") < 9.0


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_charges_are_told_apart(deficiency: str) -> None:
    charges = charge_rgb(np.arange(-CHARGE_RANGE, CHARGE_RANGE + 1.0))
    assert least(charges, deficiency) > CHARGES_APART
    # darker away from 0 on both sides: also without any colour
    light = lab(charges, deficiency)[:, 0]
    assert (np.diff(light)[:CHARGE_RANGE] > 8.0).all()
    assert (np.diff(light)[CHARGE_RANGE:] < -8.0).all()
    film = lab(as_rgb(FILM_COLOUR)[None], deficiency)
    assert ciede2000(lab(charges, deficiency), np.repeat(film, len(charges), axis=0)).min() > FILMS_APART


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_outlines_and_curves_are_told_apart(deficiency: str) -> None:
    assert least(np.stack([as_rgb(colour) for colour in OUTLINES.values()]), deficiency) > OUTLINES_APART
    # curves of one panel differ in their dashes too
    assert len({dash for _, dash in _CURVES[:4]}) == 4
    assert least(np.stack([as_rgb(colour) for colour, _ in _CURVES]), deficiency) > OUTLINES_APART


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_the_ramp_grows_lighter(deficiency: str) -> None:
    light = lab(ramp_rgb(np.linspace(0.0, 1.0, 60), (0.0, 1.0)), deficiency)[:, 0]
    assert (np.diff(light) > 0.0).all()


def test_six_sides_are_the_middle_of_the_diverging_colours() -> None:
    """Hexagons, charge 0 and curvature 0 have one colour; more sides and saddles are blue."""
    middle = charge_rgb(np.zeros(1))
    np.testing.assert_array_equal(diverging_rgb(np.zeros(1), 2.0), middle)
    np.testing.assert_array_equal(
        diverging_rgb(np.array([-1.0, 1.0]), 1.0), charge_rgb(np.array([-3.0, 3.0]))
    )
    blue, red = charge_rgb(np.array([-1.0, 1.0])).astype(int)
    assert blue[2] > blue[0]
    assert red[0] > red[2]


def test_the_same_colour_in_every_picture() -> None:
    foam = sphere_foam(60)
    table = {
        q: tuple(rgb)
        for q, rgb in zip(range(-3, 4), (charge_rgb(np.arange(-3.0, 4.0)) / 255.0).tolist(), strict=True)
    }
    (scalar,) = [s for s in bubble_scalars([foam], [np.ones(1)]) if s.name == "charge"]
    charges = foam.network.charges
    np.testing.assert_array_equal(scalar.rgb[0] / 255.0, np.array([table[q] for q in charges.tolist()]))
    fills = plot_map(foam).axes[0].collections[0].get_facecolors()[:, :3]
    np.testing.assert_allclose(fills, scalar.rgb[0] / 255.0)
    for figure in (plot_foam(foam), plot_defects(foam), plot_map(foam), plot_foam(foam, width=86.0)):
        legends = [*figure.legends, *(a.get_legend() for a in figure.axes if a.get_legend())]
        for patch, text in zip(legends[0].get_patches(), legends[0].get_texts(), strict=True):
            n = int(text.get_text().split()[2])
            assert patch.get_facecolor()[:3] == pytest.approx(table[6 - n])
    for name in ("sides", "charge"):
        bars = plot_histogram(foam, name).axes[0].patches
        for bar in bars:
            at = round(bar.get_x() + 0.5 * bar.get_width())
            assert bar.get_facecolor()[:3] == pytest.approx(table[6 - at if name == "sides" else at])


def test_an_exterior_that_is_a_disk_is_grey_too() -> None:
    """Round one cluster on a sphere: not of some charge, and no bubble to be counted."""
    foam = replace(lone_bubble(), exterior=1)
    found = bubble_colours(foam, "area")
    assert found.inside.tolist() == [True, False]
    assert found.limits == (foam.bubble_areas[0], foam.bubble_areas[0])
    np.testing.assert_array_equal(bubble_colours(foam).rgb[1], as_rgb(OUTSIDE_COLOUR))
    assert plot_map(foam).axes[0].get_title().startswith("1 bubble on a sphere")


def test_values_of_the_callers_own() -> None:
    foam = with_pressures(torus_foam())
    values = np.linspace(0.0, 1.0, 96)
    values[5] = np.nan
    found = bubble_colours(foam, values, "speed (mm/s)")
    assert found.limits == (0.0, 1.0)
    assert found.label == "speed (mm/s)"
    assert found.kind == "ramp"
    np.testing.assert_array_equal(found.rgb[5], as_rgb(OUTSIDE_COLOUR))
    np.testing.assert_array_equal(found.rgb[[0, -1]], ramp_rgb(np.array([0.0, 1.0]), (0.0, 1.0)))
    for name in ("volume", "curvature"):
        assert bubble_colours(foam, name).kind == ("diverging" if name == "curvature" else "ramp")
    grey = bubble_colours(bubble_on_torus(), np.array([1.0, 2.0]))
    np.testing.assert_array_equal(grey.rgb[1], as_rgb(OUTSIDE_COLOUR))
    for bad, fault in (
        (None, TypeError),
        (3.0, TypeError),
        (np.zeros((96, 2)), ValueError),
        (["a"] * 96, TypeError),
    ):
        with pytest.raises(fault, match="color_by must"):
            bubble_colours(foam, bad)
