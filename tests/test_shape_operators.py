"""Shape operators of every surface: against normals, curvatures and frames."""

from __future__ import annotations

import numpy as np
import pytest

from .level_samples import FAMILY
from .surface_samples import SURFACES

EVERY = [*SURFACES, *(member.surface for member in FAMILY.values())]
every = pytest.mark.parametrize("surface", EVERY, ids=lambda s: repr(s)[:40])


def scale(surface):
    return 1.0 / max(*(abs(k) for k in surface.curvature_range()), 1.0 / surface.size)


@every
def test_eigenvalues_are_the_principal_curvatures_and_the_normal_is_flat(surface):
    x = surface.random_points(60, 1)
    w, n = surface.shape_operators(x), surface.normals(x)
    size = scale(surface)
    assert w.shape == (60, 3, 3)
    np.testing.assert_allclose(w * size, w.transpose(0, 2, 1) * size, atol=1e-13)
    np.testing.assert_allclose(np.einsum("nxy,ny->nx", w, n) * size, 0.0, atol=1e-12)
    e = surface.vertex_frames(x)
    inside = np.einsum("nix,nxy,njy->nij", e, w, e)
    want = np.sort(surface.principal_curvatures(x), axis=1)
    np.testing.assert_allclose(np.linalg.eigvalsh(inside) * size, want * size, atol=1e-7)
    np.testing.assert_allclose(
        np.linalg.det(inside) * size**2, surface.gaussian_curvature(x) * size**2, atol=1e-12
    )


@every
def test_they_are_differences_of_normals(surface):
    x = surface.random_points(40, 2)
    w, e = surface.shape_operators(x), surface.vertex_frames(x)
    h = 1e-4 * scale(surface)
    for k in range(2):
        step = np.zeros((40, 2))
        step[:, k] = h
        change = surface.normals(surface.retract(x, step)) - surface.normals(surface.retract(x, -step))
        want = np.einsum("nxy,ny->nx", w, e[:, k])
        np.testing.assert_allclose(change / (2 * h) * scale(surface), want * scale(surface), atol=2e-6)


@every
def test_points_off_the_surface_are_projected_or_not(surface):
    x = surface.random_points(30, 3)
    size = scale(surface)
    np.testing.assert_allclose(
        surface.shape_operators(x, project=False) * size, surface.shape_operators(x) * size, atol=1e-9
    )
    lifted = x + 0.02 * size * surface.normals(x)
    np.testing.assert_allclose(
        surface.shape_operators(lifted) * size, surface.shape_operators(x) * size, atol=1e-6
    )
    with pytest.raises(ValueError, match="points must have shape"):
        surface.shape_operators([1.0, 2.0, 3.0])
