import numpy as np
import pytest

from dsl_core.analysis.areas import pixel_areas_mm2


def test_a_tilted_plane_has_its_area_whatever_the_noise_of_depth() -> None:
    rng, focal = np.random.default_rng(3), 200.0
    v, u = np.mgrid[0:60, 0:80].astype(float)
    ray = np.stack([(u - 39.5) / focal, (v - 29.5) / focal, np.ones_like(u)])
    normal = np.array([np.sin(0.7), 0.0, -np.cos(0.7)])
    depth = 700 * normal[2] / np.tensordot(normal, ray, 1)
    normals = np.broadcast_to(normal[:, None, None], ray.shape)
    areas = pixel_areas_mm2(ray * depth, normals)
    # The plane's part between the outermost pixel centres and half a pixel beyond them, by its corners.
    corners = np.array([[x, y, 1.0] for x, y in ((-40, -30), (40, -30), (40, 30), (-40, 30))])
    corners[:, :2] /= focal
    a, b, c, d = (corner * 700 * normal[2] / (normal @ corner) for corner in corners)
    whole = np.linalg.norm(np.cross(b - a, c - a)) / 2 + np.linalg.norm(np.cross(c - a, d - a)) / 2
    assert areas.sum() == pytest.approx(whole, rel=2e-3)
    noisy = pixel_areas_mm2(ray * (depth + rng.normal(0, 1.0, depth.shape)), normals)
    assert noisy.sum() == pytest.approx(whole, rel=5e-3)


def test_pixels_without_a_point_have_no_area() -> None:
    points = np.full((3, 4, 4), np.nan)
    assert np.isnan(pixel_areas_mm2(points)).all()
