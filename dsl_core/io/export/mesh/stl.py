"""A surface as binary STL, in mm, which STL does not say but all programs assume.

Layout: 3D Systems, StereoLithography Interface Specification (1989): 80 bytes of text, the number of
triangles, and for each its normal, its three corners and two unused bytes.
"""

from __future__ import annotations

import struct

import numpy as np

from dsl_core.io.export.mesh.surface import Surface

_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])


def stl_bytes(surface: Surface, text: str) -> bytes:
    """The file; of ``text`` its header holds the first characters, and never the word that means text STL."""
    corners = surface.points_mm[surface.triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(areas, axis=1, keepdims=True)
    table = np.zeros(len(corners), _TRIANGLE)
    table["normal"], table["corners"] = areas / np.where(length > 0, length, 1), corners
    header = f"binary STL, unit mm, {text}".encode("ascii", "replace")[:80]
    return header.ljust(80) + struct.pack("<I", len(table)) + table.tobytes()
