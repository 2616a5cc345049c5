"""Gap against curvature: how far the outer tube of a torus must be shifted to stop a bubble on top.

On the paper's torus (R = 20, r = 4, gap 0.5) a bubble of volume 0.5 drifts to the outer equator. An outer
tube shifted outwards by a widens the gap there by about a cos φ, and the bubble prefers narrow places. The
paper balances both where |δd| = |GV/3π|; theory of second order and the computed film say how far it is off.

    python examples/08_gap_against_curvature.py
"""

from __future__ import annotations

import numpy as np

import warpedfoam as wf
from warpedfoam import theory

GAP, VOLUME = 0.5, 0.5


def main() -> tuple[float, float, float]:
    """Return the shift that stops the bubble, in units of the paper's, that of theory, and the next force."""
    torus = wf.Torus(major_radius=20.0, minor_radius=4.0)
    top = torus.points(np.array([0.5 * np.pi]), np.zeros(1))
    up = torus.vertex_frames(top)[0, 0]  # along growing φ

    def force(shift: float) -> float:
        cell = wf.HeleShawCell(torus, gap=wf.ShiftedTubeGap(torus, GAP, outward=shift))
        held = wf.cluster_potential(cell, 1, volumes=VOLUME, points=top)
        return float(held.forces[0] @ up)

    # G = cos φ/(r (R + r cos φ)) grows by 1/(r R) with cos φ on top
    paper = float(theory.balancing_gap_change(VOLUME, 1.0 / (20.0 * 4.0)))
    phi = 0.5 * np.pi + np.array([-0.01, 0.01])
    ends = theory.second_order_balance(VOLUME, GAP, *theory.torus_curvatures(phi, 20.0, 4.0), film="ruled")
    second = float((ends[0] - ends[1]) / (np.cos(phi[0]) - np.cos(phi[1])))

    # the force is nearly linear in the shift: one secant is enough
    a, b = 0.9 * paper, paper
    low, high = force(a), force(b)
    found = a - low * (b - a) / (high - low)
    left = force(found)
    print(f"paper          |GV/3 pi|  a = {paper:.4e}   force there {high:.2e}")
    print(f"second order              a = {second:.4e}   {second / paper:.4f} of the paper's")
    print(f"computed                  a = {found:.4e}   {found / paper:.4f}, force left {left:.1e}")
    return found / paper, second / paper, left


if __name__ == "__main__":
    main()
