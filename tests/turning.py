"""What the tests of T1s share: which films may turn, and whether two networks are the same."""

from __future__ import annotations

import numpy as np

from warpedfoam.moves.t1 import allowed, t1_sites


def every_site(network):
    return t1_sites(network, np.arange(network.n_films))


def may_turn(network):
    return np.flatnonzero(allowed(network, every_site(network)))


def same(one, two):
    return all(
        np.array_equal(getattr(one, k), getattr(two, k)) for k in ("next", "origin", "bubble", "bubble_euler")
    )
