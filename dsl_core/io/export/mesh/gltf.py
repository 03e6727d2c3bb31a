"""A surface as binary glTF 2.0 (.glb), in metres.

Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022): lengths in metres, y up, the front towards +z,
one file with a JSON chunk and a binary chunk, each padded to four bytes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.export.mesh.surface import Surface, png_bytes

_ARRAY, _INDICES = 34962, 34963
_FLOAT, _UNSIGNED = 5126, 5125
#: From the camera's frame (y down, z forward) to glTF's (y up, z backward): half a turn about x.
_TURNED = np.array([1, -1, -1], np.float32)


class _Buffer:
    """The binary chunk with its views and accessors."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, content: bytes, target: int | None = None) -> int:
        """Append bytes; returns the number of their view."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": len(content)}
        if target is not None:
            view["target"] = target
        padded = content + b"\0" * (-len(content) % 4)
        self.parts.append(padded)
        self.size += len(padded)
        self.views.append(view)
        return len(self.views) - 1

    def accessor(self, values: NDArray[Any], form: str, limits: bool = False) -> int:
        """Append an array; returns the number of its accessor."""
        is_index = form == "SCALAR"
        kind, component, target = ("<u4", _UNSIGNED, _INDICES) if is_index else ("<f4", _FLOAT, _ARRAY)
        values = np.ascontiguousarray(values, kind)
        entry: dict[str, Any] = {
            "bufferView": self.view(values.tobytes(), target),
            "componentType": component,
            "count": len(values),
            "type": form,
        }
        if limits:
            entry["min"] = [float(value) for value in values.min(0)]
            entry["max"] = [float(value) for value in values.max(0)]
        self.accessors.append(entry)
        return len(self.accessors) - 1


def glb_bytes(surface: Surface, name: str, origin: Mapping[str, str]) -> bytes:
    """The file; ``origin`` goes into the extras of its asset."""
    buffer = _Buffer()
    attributes = {
        "POSITION": buffer.accessor(surface.points_mm * (_TURNED / 1000), "VEC3", limits=True),
        "NORMAL": buffer.accessor(surface.normals * _TURNED, "VEC3"),
    }
    material: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    content: dict[str, Any] = {}
    if surface.texture is not None:
        attributes["TEXCOORD_0"] = buffer.accessor(surface.places, "VEC2")
        image = buffer.view(png_bytes(surface.texture))
        content["images"] = [{"bufferView": image, "mimeType": "image/png"}]
        # Linear, clamped to the edge.
        content["samplers"] = [{"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}]
        content["textures"] = [{"source": 0, "sampler": 0}]
        material["baseColorTexture"] = {"index": 0}
    primitive = {
        "attributes": attributes,
        "indices": buffer.accessor(surface.triangles.ravel(), "SCALAR"),
        "material": 0,
    }
    content |= {
        "asset": {
            "version": "2.0",
            "generator": origin.get("exported_by", "dsl-scan"),
            "extras": dict(origin),
        },
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": [primitive]}],
        "materials": [{"pbrMetallicRoughness": material, "doubleSided": True}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.size}],
    }
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + buffer.size)
    chunks = struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", buffer.size, b"BIN\0")
    return b"".join([head, *chunks, *buffer.parts])
