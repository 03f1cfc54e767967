#!/usr/bin/env python3
"""Simplifies a glTF file with MeshLab's quadric edge collapse and writes a GLB, for `lodbake study`.

    meshlab.py IN OUT.glb RATIO [--positions-only]

Every triangle primitive is simplified for itself: positions are welded first (MeshLab would tear it at seams else), texture
coordinates go along as wedges with the filter that weighs them, unless `--positions-only` asks for the plain one. MeshLab
forgets the source's normals; each corner gets that of the nearest source vertex which faces the same way, else the face's.
Other attributes, skins and animations are dropped. Needs `pymeshlab`, `numpy` and `scipy` (see studies/README.md).
"""

import argparse
import base64
import json
import struct
import sys
import tempfile
import urllib.parse
from pathlib import Path

import numpy as np
import pymeshlab
from scipy.spatial import cKDTree

TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
LARGEST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}
# A source vertex lends its normal to a corner if it faces the same way as the corner's face, within 60 degrees.
SAME_WAY = 0.5
NEIGHBOURS = 12
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGP4DwABAQEAsTj2FAAAAABJRU5ErkJggg=="
)


class Refused(Exception):
    """The input is of a kind that this runner does not take."""


class Source:
    """A glTF document and its bytes."""

    def __init__(self, path):
        self.folder = path.parent
        data = path.read_bytes()
        chunk = None
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            self.json = json.loads(data[20 : 20 + length])
            rest = data[20 + length :]
            chunk = rest[8 : 8 + struct.unpack_from("<I", rest)[0]] if len(rest) > 8 else b""
        else:
            self.json = json.loads(data)
        needed = set(self.json.get("extensionsRequired", []))
        if refused := needed - {"KHR_mesh_quantization", "KHR_texture_transform"}:
            raise Refused(f"it requires {', '.join(sorted(refused))}")
        self.buffers = [self.load(buffer["uri"]) if "uri" in buffer else chunk for buffer in self.json.get("buffers", [])]

    def load(self, uri):
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.folder / urllib.parse.unquote(uri)).read_bytes()

    def view(self, index):
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][start : start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        """Rows of an accessor, as floats if it is normalised."""
        accessor = self.json["accessors"][index]
        if "sparse" in accessor or "bufferView" not in accessor:
            raise Refused("it has sparse accessors")
        kind, width = np.dtype(TYPES[accessor["componentType"]]), COMPONENTS[accessor["type"]]
        data, stride = self.view(accessor["bufferView"])
        row, offset = kind.itemsize * width, accessor.get("byteOffset", 0)
        rows = np.lib.stride_tricks.as_strided(
            np.frombuffer(data, np.uint8)[offset:], (accessor["count"], row), (stride or row, 1)
        )
        values = np.ascontiguousarray(rows).view(kind)
        if accessor.get("normalized"):
            values = np.maximum(values / LARGEST[accessor["componentType"]], -1)
        return values


class Target:
    """The document on its way out: the source's, with new accessors and one buffer."""

    def __init__(self, source):
        self.json, self.bytes = json.loads(json.dumps(source.json)), bytearray()
        for image in self.json.get("images", []):
            data = source.view(image["bufferView"])[0] if "bufferView" in image else source.load(image["uri"])
            image["bufferView"] = ("image", bytes(data))
            image.setdefault("mimeType", "image/png" if data[:4] == b"\x89PNG" else "image/jpeg")
            image.pop("uri", None)
        self.json["accessors"], self.json["bufferViews"] = [], []
        for image in self.json.get("images", []):
            image["bufferView"] = self.view(image["bufferView"][1])
        for name in ("animations", "skins", "extensionsRequired"):
            self.json.pop(name, None)
        for node in self.json.get("nodes", []):
            for name in ("skin", "weights"):
                node.pop(name, None)

    def view(self, data):
        self.bytes.extend(b"\0" * (-len(self.bytes) % 4))
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)})
        self.bytes.extend(data)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, component, kind):
        entry = {"bufferView": self.view(values.tobytes()), "componentType": component, "count": len(values), "type": kind}
        if kind == "VEC3":
            entry |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        self.json["accessors"].append(entry)
        return len(self.json["accessors"]) - 1

    def write(self, path):
        self.bytes.extend(b"\0" * (-len(self.bytes) % 4))
        self.json["buffers"] = [{"byteLength": len(self.bytes)}]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        parts = [struct.pack("<II", len(text), 0x4E4F534A), text, struct.pack("<II", len(self.bytes), 0x004E4942), self.bytes]
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + sum(map(len, parts))) + b"".join(parts))


def triangles(source, primitive, count):
    if primitive.get("mode", 4) != 4:
        raise Refused("it has other primitives than lists of triangles")
    indices = source.accessor(primitive["indices"]).reshape(-1) if "indices" in primitive else np.arange(count)
    return indices.astype(np.int64).reshape(-1, 3)


def load_textured(meshes, positions, corners, texcoords, wedges):
    """Through a file: only there does MeshLab take the number of a texture with each wedge, without which the filter refuses."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.obj"
        (path.parent / "pixel.png").write_bytes(PIXEL)
        (path.parent / "mesh.mtl").write_text("newmtl one\nmap_Kd pixel.png\n")
        lines = ["mtllib mesh.mtl", "usemtl one"]
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in positions.tolist()]
        lines += [f"vt {u!r} {v!r}" for u, v in texcoords.tolist()]
        pairs = np.stack([corners, wedges], 2) + 1
        lines += ["f " + " ".join(f"{v}/{t}" for v, t in face) for face in pairs.tolist()]
        path.write_text("\n".join(lines))
        meshes.load_new_mesh(str(path))


def simplified(positions, faces, texcoords, ratio):
    """Corners of the triangles that MeshLab leaves: positions and texture coordinates."""
    welded, place = np.unique(positions, axis=0, return_inverse=True)
    corners = place.reshape(-1)[faces]
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    corners = corners[whole]
    meshes = pymeshlab.MeshSet()
    if texcoords is None:
        meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=welded.astype(np.float64), face_matrix=corners.astype(np.int32)))
    else:
        load_textured(meshes, welded, corners, texcoords, faces[whole])
    options = {"targetfacenum": max(1, round(len(corners) * ratio)), "preservenormal": True, "qualitythr": 0.3}
    if texcoords is not None:
        meshes.apply_filter("meshing_decimation_quadric_edge_collapse_with_texture", **options)
    else:
        meshes.apply_filter("meshing_decimation_quadric_edge_collapse", optimalplacement=True, **options)
    mesh = meshes.current_mesh()
    if mesh.face_number() == 0:
        return None
    at = mesh.vertex_matrix()[mesh.face_matrix()]
    return at, None if texcoords is None else mesh.wedge_tex_coord_matrix().reshape(-1, 3, 2)


def normals_for(corners, positions, normals):
    """One for each corner of (n, 3, 3) triangles."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    own = np.repeat(across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30), 3, axis=0)
    if normals is None:
        return own
    near = cKDTree(positions).query(corners.reshape(-1, 3), k=min(NEIGHBOURS, len(positions)))[1].reshape(len(own), -1)
    offered = normals[near]
    fits = np.einsum("ckx,cx->ck", offered, own) >= SAME_WAY
    chosen = offered[np.arange(len(own)), fits.argmax(1)]
    return np.where(fits.any(1)[:, None], chosen, own)


def rebuild(source, target, primitive, ratio, positions_only):
    """`primitive` of the target becomes the simplified one; False if nothing is left of it."""
    attributes = primitive["attributes"]
    read = lambda name: source.accessor(attributes[name]).astype(np.float64) if name in attributes else None
    positions, normals, texcoords = read("POSITION"), read("NORMAL"), read("TEXCOORD_0")
    faces = triangles(source, primitive, len(positions))
    weighed = None if positions_only else texcoords
    left = simplified(positions, faces, weighed, ratio)
    if left is None:
        return False
    corners, uvs = left
    if texcoords is not None and uvs is None:
        # The plain filter forgets them: those of the nearest source vertex.
        uvs = texcoords[cKDTree(positions).query(corners.reshape(-1, 3))[1]].reshape(-1, 3, 2)
    columns = [corners.reshape(-1, 3), normals_for(corners, positions, normals)]
    if uvs is not None:
        columns.append(uvs.reshape(-1, 2))
    rows, indices = np.unique(np.hstack(columns).astype(np.float32), axis=0, return_inverse=True)
    primitive["attributes"] = {
        "POSITION": target.accessor(np.ascontiguousarray(rows[:, :3]), 5126, "VEC3"),
        "NORMAL": target.accessor(np.ascontiguousarray(rows[:, 3:6]), 5126, "VEC3"),
    }
    if uvs is not None:
        primitive["attributes"]["TEXCOORD_0"] = target.accessor(np.ascontiguousarray(rows[:, 6:]), 5126, "VEC2")
    primitive["indices"] = target.accessor(indices.reshape(-1).astype(np.uint32), 5125, "SCALAR")
    for name in ("targets", "extensions"):
        primitive.pop(name, None)
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("source", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("ratio", type=float)
    parser.add_argument("--positions-only", action="store_true", help="the filter that ignores texture coordinates")
    options = parser.parse_args()
    try:
        source = Source(options.source)
        target = Target(source)
        for number, mesh in enumerate(target.json.get("meshes", [])):
            keep = lambda p: rebuild(source, target, p, options.ratio, options.positions_only)
            mesh["primitives"] = [primitive for primitive in mesh["primitives"] if keep(primitive)]
            if not mesh["primitives"]:
                raise Refused(f"MeshLab leaves nothing of mesh {number}")
    except (Refused, OSError, pymeshlab.PyMeshLabException) as error:
        sys.exit(f"{options.source.name}: {error}")
    target.write(options.out)


if __name__ == "__main__":
    main()
