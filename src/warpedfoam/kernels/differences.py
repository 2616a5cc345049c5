"""Gradient and second derivatives of a function of points by central differences of sixth order."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from warpedfoam.arrays import Floats

#: Weights of f(±h), f(±2h), f(±3h) in h f' and h² f'', and of f(0) in the latter.
FIRST = np.array([3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0])
SECOND = np.array([3.0 / 2.0, -3.0 / 20.0, 1.0 / 90.0])
MIDDLE = -49.0 / 18.0
#: Steps that are tried, in lengths: the best one balances round-off against the function's own scale.
STEPS = (2e-2, 6e-3, 2e-3, 6e-4, 2e-4, 6e-5)

Function = Callable[[Floats], Floats]


def differences(
    function: Function, points: Floats, step: float, *, second: bool
) -> tuple[Floats, Floats, Floats | None]:
    """f (n,), ∇f (n, 3) and, if asked for, ∇²f (n, 3, 3); the function takes (m, 3) points.

    Mixed derivatives come from second ones along e_i + e_j.

    Examples
    --------
    >>> x = np.array([[0.3, -0.2, 0.5]])
    >>> _, slope, bend = differences(lambda p: p[:, 0] ** 2 * p[:, 1], x, 0.01, second=True)
    >>> slope[:, :2].round(9).tolist(), bend[0, 0, :2].round(8).tolist()
    ([[-0.12, 0.09]], [-0.4, 0.6])
    """
    axes = np.eye(3)
    pairs = ((0, 1), (0, 2), (1, 2))
    ways = np.concatenate([axes, [axes[i] + axes[j] for i, j in pairs]]) if second else axes
    reach = step * np.array([1.0, 2.0, 3.0, -1.0, -2.0, -3.0])
    places = points + (reach[:, None, None] * ways)[:, :, None]
    found = function(np.concatenate([points, places.reshape(-1, 3)]))
    value, around = found[: len(points)], found[len(points) :].reshape(6, len(ways), len(points))
    ahead, behind = around[:3], around[3:]
    gradient = np.einsum("s,sdn->nd", FIRST / step, (ahead - behind)[:, :3])
    if not second:
        return value, gradient, None
    along = np.einsum("s,sdn->dn", SECOND, ahead + behind) + MIDDLE * value
    along /= step**2
    hessian = np.empty((len(points), 3, 3))
    for i in range(3):
        hessian[:, i, i] = along[i]
    for k, (i, j) in enumerate(pairs):
        hessian[:, i, j] = hessian[:, j, i] = 0.5 * (along[3 + k] - along[i] - along[j])
    return value, gradient, hessian


def best_step(function: Function, points: Floats, length: float) -> tuple[float, float]:
    """The step of `differences` that gives the best gradient at the points, and its error there.

    Of the steps `STEPS` times ``length`` the one whose gradient changes least when the step is lessened; the
    largest change is an estimate of the error, in units of f.
    """
    with np.errstate(all="ignore"):
        slopes = [differences(function, points, share * length, second=False)[1] for share in STEPS]
        change = np.array([np.abs(b - a).max() for a, b in pairwise(slopes)])
    # a large step may lead to where the function is not defined
    change[~np.isfinite(change)] = np.inf
    best = int(np.argmin(change))
    return STEPS[best] * length, float(change[best])
