#!/usr/bin/env python3
"""What `layout = "library"` saves: bytes of all outputs (scenes, buffers, the library; no images, no report), self-contained and with
the library, and how many of its files several scenes have.

With `--scenes N` the folder is not baked as it is: N scenes are made of its GLBs first, `--props K` of them each, chosen by a fixed
sequence; their materials are white and their scenes flat, geometry is as it was. That is a game's levels: few props in many places.

    library.py [--lodbake PATH] [--scenes N] [--props K] FOLDER..
"""

import argparse
import json
import shutil
import struct
import subprocess
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OWN = "lodbake-library/"


def load(path):
    data = path.read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + length]), data[20 + length + 8 :]


def write(path, document, binary):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def is_plain(path):
    document, _ = load(path)
    return not any(key in document for key in ("extensionsRequired", "skins", "animations")) and len(document["buffers"]) == 1


def compose(props, path):
    """One scene in which the meshes of all props stand in a row."""
    out = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [], "accessors": [],
           "bufferViews": [], "materials": [{"name": "white"}]}
    binary = b""
    for place, prop in enumerate(props):
        document, data = load(prop)
        base = {key: len(out[key]) for key in ("accessors", "bufferViews", "meshes")}
        for view in document["bufferViews"]:
            out["bufferViews"].append({**view, "byteOffset": view.get("byteOffset", 0) + len(binary)})
        binary += data + b"\0" * (-len(data) % 4)
        for accessor in document["accessors"]:
            out["accessors"].append({**accessor, "bufferView": accessor["bufferView"] + base["bufferViews"]})
        for index, mesh in enumerate(document["meshes"]):
            primitives = [
                {
                    "attributes": {name: a + base["accessors"] for name, a in primitive["attributes"].items()},
                    "indices": primitive["indices"] + base["accessors"],
                    "material": 0,
                }
                for primitive in mesh["primitives"]
            ]
            out["meshes"].append({"name": mesh.get("name", "mesh"), "primitives": primitives})
            out["scenes"][0]["nodes"].append(len(out["nodes"]))
            out["nodes"].append({"mesh": base["meshes"] + index, "translation": [2 * place, 0, 0]})
    out["buffers"] = [{"byteLength": len(binary)}]
    write(path, out, binary)


def bake(lodbake, folders, work, layout, cache):
    folder = work / layout
    folder.mkdir()
    pipeline = folder / "pipeline.toml"
    pipeline.write_text(
        f"input = {json.dumps([str(f) for f in folders])}\noutput = 'out'\nlayout = '{layout}'\nappearance.record = false\n"
    )
    began = time.perf_counter()
    # Scenes that are broken on purpose are named and left out.
    subprocess.run([lodbake, "--quiet", pipeline, "--cache", cache], check=False, capture_output=True)
    return json.loads((folder / "out" / "report.json").read_text()), time.perf_counter() - began


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lodbake", default=ROOT / "target/release/lodbake", type=Path)
    parser.add_argument("--scenes", type=int)
    parser.add_argument("--props", type=int, default=8)
    parser.add_argument("folders", nargs="+", type=Path)
    options = parser.parse_args()
    work = Path(tempfile.mkdtemp())
    folders = [folder.resolve() for folder in options.folders]
    if options.scenes:
        found = sorted(path for folder in folders for path in folder.rglob("*.glb") if is_plain(path))
        (work / "made").mkdir()
        state = 1
        for number in range(options.scenes):
            props = []
            for _ in range(options.props):
                state = state * 6364136223846793005 + 1442695040888963407 & (1 << 64) - 1
                props.append(found[(state >> 33) % len(found)])
            compose(props, work / "made" / f"{number:05}.glb")
        folders = [work / "made"]
    own, first = bake(options.lodbake, folders, work, "self-contained", work / "cache")
    shared, second = bake(options.lodbake, folders, work, "library", work / "cache")
    users = Counter(o["path"] for scene in shared["scenes"] for o in scene["outputs"] if o["path"].startswith(OWN))
    before, after = own["totals"]["bytes_out"], shared["totals"]["bytes_out"]
    print(f"{own['totals']['files']} scenes, {own['totals']['bytes_in']:,} bytes: self-contained {before:,} bytes ({first:.1f} s), "
          f"library {after:,} ({100 * (after / before - 1):+.1f} %; {second:.1f} s with the cache of the first)")
    print(f"{len(users)} files in the library, {sum(1 for n in users.values() if n > 1)} of them in several scenes, "
          f"{sum(users.values())} references")
    shutil.rmtree(work)


main()
