"""The kinds of surface that the command line knows, and their sizes unless told otherwise."""

from __future__ import annotations

from collections.abc import Mapping

SIZES: Mapping[str, Mapping[str, float | str]] = {
    "torus": {"major_radius": 20.0, "minor_radius": 4.0},
    "sphere": {"radius": 10.0},
    "ellipsoid": {"a": 10.0, "b": 12.0, "c": 15.0},
    "cylinder": {"radius": 6.0, "height": 40.0},
    "open_cylinder": {"radius": 6.0, "height": 20.0},
    "catenoid": {"neck_radius": 6.0, "height": 14.0},
    "flat_torus": {"width": 40.0, "height": 30.0},
    "schwarz_p": {"cell_length": 20.0},
    "implicit": {
        "formula": "(hypot(x, y) - 16)**2 + z**2 * (1 + x/40) - 36",
        "bounds": "-26, -26, -12, 26, 26, 12",
    },
    "graph": {"formula": "2 * cos(pi*x/20) * cos(pi*y/15)", "width": 40.0, "height": 30.0, "edge": "rim"},
    "revolution": {"formula": "(8 + 2 * sin(z/4))**2", "bottom": -12.0, "top": 12.0},
    "mesh": {"file": ""},
}
#: Those that may be of any sign.
SIGNED = ("bottom", "top")
