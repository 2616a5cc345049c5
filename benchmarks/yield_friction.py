"""What yield friction stops one bubble on the paper's torus, and beyond which angle.

A bubble that a force F drives along the plates moves if F > τ ∮ |ν·e| dA over its film: about 4 ρ τ d, with
ρ its radius. Prints the least τ that holds it everywhere, and where it moves at half of that. With --check a
bubble of volume 0.5 is let go a little below and above it.

    PYTHONPATH=src python benchmarks/yield_friction.py [--check]
"""

from __future__ import annotations

import sys

import numpy as np

import warpedfoam as wf

TORUS = wf.Torus(major_radius=20.0, minor_radius=4.0)
CELL = wf.HeleShawCell(TORUS, gap=0.5)
VOLUMES = (0.3, 0.4, 0.5, 0.6, 0.7)
DEGREES = np.arange(0.0, 181.0, 6.0)


def resistance(foam: wf.Foam, along: np.ndarray) -> float:
    """∮ |ν·e| dA of the films against a motion of all points along tangent fields e, τ = 1."""
    from warpedfoam.motion.drag import Across
    from warpedfoam.relax.system import State

    state = State(foam.network, foam.vertex_points, foam.film_offsets, np.zeros(foam.n_bubbles))
    here = Across(foam.cell, state, 1.0)
    nodes = foam.film_curves_at(_nodes(foam.order))
    slope = np.einsum("kl,flx->fkx", _slopes(foam.order), nodes)
    normal = TORUS.normals(nodes.reshape(-1, 3)).reshape(nodes.shape)
    across = np.cross(normal, slope)
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    return float((here.areas * np.abs(across @ along).T).sum())


def _nodes(order: int) -> np.ndarray:
    from warpedfoam.kernels.quadrature import lobatto

    return lobatto(order).nodes


def _slopes(order: int) -> np.ndarray:
    from warpedfoam.kernels.quadrature import lobatto

    return lobatto(order).derivative


def thresholds(volume: float, degrees: np.ndarray) -> tuple[np.ndarray, np.ndarray, wf.ClusterPotential]:
    """τ at each angle, F, and the bubbles."""
    at = TORUS.points(np.radians(degrees), np.zeros(len(degrees)))
    held = wf.cluster_potential(CELL, 1, volumes=volume, points=at, order=8)
    up = TORUS.vertex_frames(held.points)[:, 0]
    force = np.abs(np.einsum("nx,nx->n", held.forces, up))
    brake = np.array([resistance(foam, e) for foam, e in zip(held.foams, up, strict=True)])
    return force / brake, force, held


def main(check: bool = False) -> None:
    print("volume   radius  tau that holds it  worst at phi  F/(4 rho d)  at half of tau it moves between")
    for volume in VOLUMES:
        tau, force, held = thresholds(volume, DEGREES)
        top = int(np.argmax(tau))
        fine = np.polyfit(DEGREES[top - 1 : top + 2], tau[top - 1 : top + 2], 2)
        peak = -0.5 * fine[1] / fine[0]
        most = np.polyval(fine, peak)
        radius = np.sqrt(held.foams[top].bubble_areas[0] / np.pi)
        rising, falling = slice(0, top + 1), slice(top, None)
        low = np.interp(0.5 * most, tau[rising], DEGREES[rising])
        high = np.interp(-0.5 * most, -tau[falling], DEGREES[falling])
        rough = force[top] / (4.0 * radius * 0.5)
        print(
            f"{volume:6.1f}  {radius:7.4f}  {most:17.3e}  {peak:12.1f}  {rough:11.3e}"
            f"  {low:12.0f} and {high:.0f} degrees"
        )
        if check and volume == 0.5:
            free = force[top] / (np.pi * radius * 0.5)
            for share in (0.0, 0.5, 0.9, 1.0, 1.1):
                moved = wf.drift(
                    held.foams[top],
                    duration=200.0,
                    every=100.0,
                    yield_friction=share * most,
                    tolerance=1e-2,
                )
                phi = TORUS.angles(moved.centres[1:, 0])[0]
                speed = 4.0 * (phi[0] - phi[1]) / 100.0
                print(f"    tau x {share:.1f}: speed over F/(pi rho d lambda) {speed / free:.4f}")


if __name__ == "__main__":
    main("--check" in sys.argv[1:])
