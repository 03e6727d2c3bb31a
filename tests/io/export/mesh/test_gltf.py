"""The bytes of a glTF file: padded chunks, views one after the other, and the camera's frame turned."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dsl_core.io.export.mesh.gltf import _Buffer, glb_bytes
from dsl_core.io.export.mesh.surface import Surface, png_bytes

POINTS = np.array([[0, 0, 500], [10, 0, 510], [0, 20, 520], [10, 20, 530]], np.float32)
NORMALS = np.array([[0, 0, -1], [0, 0.6, -0.8], [0.6, 0, -0.8], [0, 1, 0]], np.float32)
PLACES = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]], np.float32)
TRIANGLES = np.array([[0, 2, 1], [1, 2, 3]], np.int32)
TEXTURE = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)


def opened(texture: np.ndarray | None, name: str = "scan") -> tuple[dict[str, Any], bytes]:
    """Content and binary chunk of a file whose frame is right."""
    surface = Surface(POINTS, NORMALS, PLACES, TRIANGLES, texture)
    made = glb_bytes(surface, name, {"exported_by": "dsl-scan 1", "rig": "twin"})
    magic, version, length = struct.unpack_from("<4sII", made)
    assert (magic, version, length) == (b"glTF", 2, len(made))
    size, kind = struct.unpack_from("<I4s", made, 12)
    assert (kind, size % 4) == (b"JSON", 0)
    binary_size, binary = struct.unpack_from("<I4s", made, 20 + size)
    assert (binary, binary_size % 4) == (b"BIN\0", 0)
    assert 28 + size + binary_size == len(made)
    return json.loads(made[20 : 20 + size]), made[28 + size :]


def array(content: dict[str, Any], chunk: bytes, number: int, kind: str) -> np.ndarray:
    view = content["bufferViews"][content["accessors"][number]["bufferView"]]
    return np.frombuffer(chunk[view["byteOffset"] :][: view["byteLength"]], kind)


@pytest.mark.parametrize("name", ["s", "sc", "sca", "scan"])
def test_vertices_are_in_metres_with_y_up_and_z_backward(name: str) -> None:
    content, chunk = opened(TEXTURE, name)
    (primitive,) = content["meshes"][0]["primitives"]
    used = primitive["attributes"]
    turned = POINTS * [1, -1, -1] / 1000
    places = content["accessors"][used["POSITION"]]
    assert array(content, chunk, used["POSITION"], "<f4").reshape(-1, 3) == pytest.approx(turned)
    assert (places["count"], places["type"], places["componentType"]) == (4, "VEC3", 5126)
    assert places["min"] == pytest.approx(turned.min(0))
    assert places["max"] == pytest.approx(turned.max(0))
    found = array(content, chunk, used["NORMAL"], "<f4").reshape(-1, 3)
    assert found == pytest.approx(NORMALS * [1, -1, -1])
    assert array(content, chunk, used["TEXCOORD_0"], "<f4").reshape(-1, 2) == pytest.approx(PLACES)
    indices = content["accessors"][primitive["indices"]]
    assert (indices["count"], indices["type"], indices["componentType"]) == (6, "SCALAR", 5125)
    assert array(content, chunk, primitive["indices"], "<u4").tolist() == TRIANGLES.ravel().tolist()
    targets = {view.get("target") for view in content["bufferViews"]}
    assert targets == {34962, 34963, None}
    assert content["bufferViews"][indices["bufferView"]]["target"] == 34963
    assert content["nodes"] == [{"mesh": 0, "name": name}]
    assert content["buffers"] == [{"byteLength": len(chunk)}]


def test_material_is_dull_and_its_texture_linear_and_clamped() -> None:
    content, chunk = opened(TEXTURE)
    material = content["materials"][0]
    assert material["doubleSided"] is True
    dull = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    assert material["pbrMetallicRoughness"] == {**dull, "baseColorTexture": {"index": 0}}
    # Numbers of OpenGL: 9729 LINEAR, 33071 CLAMP_TO_EDGE.
    assert content["samplers"] == [{"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}]
    assert content["textures"] == [{"source": 0, "sampler": 0}]
    view = content["bufferViews"][content["images"][0]["bufferView"]]
    assert chunk[view["byteOffset"] :][: view["byteLength"]] == png_bytes(TEXTURE)
    assert content["asset"]["generator"] == "dsl-scan 1"
    assert content["asset"]["extras"] == {"exported_by": "dsl-scan 1", "rig": "twin"}


def test_without_a_texture_there_is_none() -> None:
    content, _ = opened(None)
    assert not {"images", "samplers", "textures"} & set(content)
    assert content["materials"][0]["pbrMetallicRoughness"] == {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    assert set(content["meshes"][0]["primitives"][0]["attributes"]) == {"POSITION", "NORMAL"}
    assert (content["scene"], content["scenes"]) == (0, [{"nodes": [0]}])


def test_views_begin_at_multiples_of_four() -> None:
    buffer = _Buffer()
    assert [buffer.view(b"abcde"), buffer.view(b"abcd"), buffer.view(b"a", 7)] == [0, 1, 2]
    assert [view["byteOffset"] for view in buffer.views] == [0, 8, 12]
    assert [view["byteLength"] for view in buffer.views] == [5, 4, 1]
    assert (buffer.size, b"".join(buffer.parts)) == (16, b"abcde\0\0\0abcda\0\0\0")
    assert ("target" in buffer.views[0], buffer.views[2]["target"]) == (False, 7)


def test_a_texture_is_the_same_picture_as_png() -> None:
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png_bytes(TEXTURE)))), TEXTURE)
