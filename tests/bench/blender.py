#!/usr/bin/env python3
"""Simplifies a glTF file with Blender's Decimate modifier (edge collapse) and writes a GLB, for `lodbake study`.

    blender.py IN OUT.glb RATIO

Vertices that differ in attributes alone are merged on import (Blender keeps normals and texture coordinates at corners);
unmerged, the modifier tears the surface at every seam. Needs `bpy` (see studies/README.md), and input without Draco or
meshopt compression.
"""

import contextlib
import io
import sys

import bpy


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    source, out, ratio = sys.argv[1], sys.argv[2], float(sys.argv[3])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # What the importer says is of interest only if it fails.
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            bpy.ops.import_scene.gltf(filepath=source, merge_vertices=True)
    except RuntimeError as error:
        sys.exit(f"Blender cannot import it: {error}\n{said.getvalue()}")
    meshes = [thing for thing in bpy.data.objects if thing.type == "MESH"]
    if not meshes:
        sys.exit(f"Blender found no mesh in it\n{said.getvalue()}")
    for thing in meshes:
        if thing.data.shape_keys:
            sys.exit(f"`{thing.name}` has shape keys, which the modifier does not take")
        decimate = thing.modifiers.new("lodbake study", "DECIMATE")
        decimate.ratio = ratio
        decimate.use_collapse_triangulate = True
    with contextlib.redirect_stdout(said):
        bpy.ops.export_scene.gltf(filepath=out, export_format="GLB", export_apply=True)


if __name__ == "__main__":
    main()
