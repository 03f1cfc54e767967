#!/usr/bin/env python3
"""Makes scenes of any size and measures what a bake of them takes: wall time, peak memory, bytes.

    scale.py one  [--instances 13,1300,130000] [--forms nodes,gpu]   one mesh, that many instances: bytes for each further one
    scale.py many [--meshes 1000] [--instances 1000000] [--forms ..] one scene of many meshes and instances
    scale.py files [--files 20000]                                   that many small scene files, one mesh in fifty of them
    scale.py generate one|many|files FOLDER ..                       writes the scenes and measures nothing

Instances stand on a plane, at random, turned and scaled at random (`--plain`: moved only). Options: --lodbake PATH, --keep FOLDER (with
the scenes and outputs), --runs N (the least time of N cold runs), --cell RADII (of batches), --gltfpack PATH (simplifies each file to a
half beside it, one process for each file, the first 200 of them; the time is that of all at their pace). Nothing but Python's own
library is needed.
"""

import argparse
import array
import json
import math
import os
import random
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PIPELINE = """input = "scenes"
output = "out"
[appearance]
record = false
[instances]
instancing = "{form}"
cell = {cell}
[[lod]]
ratio = 0.5
[[lod]]
ratio = 0.25
[[lod]]
ratio = 0.1
"""


def rock(seed, rings, segments):
    """A closed, bumpy ball of about 2 * rings * segments triangles: positions, normals, texture coordinates, indices."""
    chance = random.Random(seed)
    waves = [(chance.randint(1, 6), chance.randint(1, 6), chance.random() * 6.3, 0.12 * chance.random()) for _ in range(5)]
    positions, texcoords = array.array("f"), array.array("f")
    for j in range(rings + 1):
        for i in range(segments + 1):
            u, v = i / segments, j / rings
            a, b = 2 * math.pi * (i % segments) / segments, math.pi * v
            r = 1 + sum(h * math.sin(m * a + p) * math.sin(b) * math.cos(n * b) for m, n, p, h in waves)
            positions.extend((r * math.sin(b) * math.cos(a), r * math.cos(b), r * math.sin(b) * math.sin(a)))
            texcoords.extend((u, v))
    indices = array.array("H")
    for j in range(rings):
        for i in range(segments):
            a = j * (segments + 1) + i
            b, c, d = a + 1, a + segments + 1, a + segments + 2
            if j > 0:
                indices.extend((a, b, d))
            if j < rings - 1:
                indices.extend((a, d, c))
    sums = [[0.0, 0.0, 0.0] for _ in range(len(positions) // 3)]
    for t in range(0, len(indices), 3):
        corners = [positions[3 * k : 3 * k + 3] for k in indices[t : t + 3]]
        e, f = [[corners[k][x] - corners[0][x] for x in range(3)] for k in (1, 2)]
        n = (e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0])
        for k in indices[t : t + 3]:
            sums[k] = [s + x for s, x in zip(sums[k], n)]
    normals = array.array("f")
    for n in sums:
        length = math.sqrt(sum(x * x for x in n)) or 1.0
        normals.extend(x / length for x in n)
    return positions, normals, texcoords, indices


def add_mesh(document, data, shape):
    def accessor(values, kind, component, width):
        view = {"buffer": 0, "byteOffset": len(data), "byteLength": len(values) * values.itemsize}
        data.extend(values.tobytes())
        data.extend(bytes(-len(data) % 4))
        document["bufferViews"].append(view)
        entry = {"bufferView": len(document["bufferViews"]) - 1, "componentType": component, "count": len(values) // width, "type": kind}
        document["accessors"].append(entry)
        return len(document["accessors"]) - 1

    positions, normals, texcoords, indices = shape
    position = accessor(positions, "VEC3", 5126, 3)
    document["accessors"][position]["min"] = [min(positions[k::3]) for k in range(3)]
    document["accessors"][position]["max"] = [max(positions[k::3]) for k in range(3)]
    attributes = {"POSITION": position, "NORMAL": accessor(normals, "VEC3", 5126, 3), "TEXCOORD_0": accessor(texcoords, "VEC2", 5126, 2)}
    document["meshes"].append({"primitives": [{"attributes": attributes, "indices": accessor(indices, "SCALAR", 5123, 1)}]})


def write_scene(path, shapes, instances, plain):
    """A GLB whose nodes, without names, show the shapes in turn."""
    document = {"asset": {"version": "2.0"}, "scene": 0, "bufferViews": [], "accessors": [], "meshes": []}
    data = bytearray()
    for shape in shapes:
        add_mesh(document, data, shape)
    chance = random.Random(1)
    side = 3.0 * math.sqrt(instances)
    texts = []
    for i in range(instances):
        node = f'"mesh":{i % len(shapes)},"translation":[{chance.random() * side:.4f},{chance.random():.4f},{chance.random() * side:.4f}]'
        if not plain:
            q = [chance.gauss(0, 1) for _ in range(4)]
            length = math.sqrt(sum(x * x for x in q))
            s = 0.7 + 0.6 * chance.random()
            node += ',"rotation":[%.7f,%.7f,%.7f,%.7f],"scale":[%.5f,%.5f,%.5f]' % (*(x / length for x in q), s, s, s)
        texts.append("{" + node + "}")
    document["buffers"] = [{"byteLength": len(data)}]
    head = json.dumps(document, separators=(",", ":"))
    roots = ",".join(map(str, range(instances)))
    text = f'{head[:-1]},"scenes":[{{"nodes":[{roots}]}}],"nodes":[{",".join(texts)}]}}'.encode()
    text += b" " * (-len(text) % 4)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as out:
        out.write(b"glTF" + struct.pack("<II", 2, 12 + 8 + len(text) + 8 + len(data)))
        out.write(struct.pack("<I", len(text)) + b"JSON" + text + struct.pack("<I", len(data)) + b"BIN\0" + data)


def write_files(folder, count, plain):
    """Small scenes of three meshes each; every mesh is in about fifty of them."""
    shapes = [rock(seed, 8, 12) for seed in range(max(3, 3 * count // 50))]
    chance = random.Random(2)
    for i in range(count):
        write_scene(folder / f"{i // 1000:02}" / f"{i:05}.glb", chance.sample(shapes, 3), 9, plain)


def timed(words):
    """Wall seconds and peak resident MiB of a program."""
    began = time.perf_counter()
    process = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{words[0]} failed: {status}")
    return time.perf_counter() - began, usage.ru_maxrss / 1024


def bake(options, folder, form):
    """Wall seconds, peak resident MiB, bytes of the outputs; from a cold cache."""
    (folder / "pipeline.toml").write_text(PIPELINE.format(form=form, cell=options.cell))
    subprocess.run(["rm", "-rf", folder / "out", folder / ".lodbake"], check=True)
    seconds, memory = timed([options.lodbake, "--quiet", folder / "pipeline.toml"])
    size = sum(f.stat().st_size for f in (folder / "out").rglob("*") if f.is_file() and f.name != "report.json")
    return seconds, memory, size


def peer(program, folder, most=200):
    """The same for one level of each file by gltfpack; of the first files, as if the others took as long."""
    files = sorted((folder / "scenes").rglob("*.glb"))
    out = folder / "peer.glb"
    seconds, memory, size = 0.0, 0.0, 0
    for file in files[:most]:
        one = timed([program, "-i", file, "-o", out, "-si", "0.5", "-noq", "-kn"])
        seconds, memory, size = seconds + one[0], max(memory, one[1]), size + out.stat().st_size
    share = len(files) / len(files[:most])
    return seconds * share, memory, int(size * share)


def measure(options, folder, what, forms):
    source = sum(f.stat().st_size for f in (folder / "scenes").rglob("*.glb"))
    found = {}
    for form in forms:
        runs = [bake(options, folder, form) for _ in range(options.runs)]
        seconds, memory, size = min(r[0] for r in runs), max(r[1] for r in runs), runs[0][2]
        found[form] = size
        print(f"| {what} | {form} | {source:,} | {size:,} | {seconds:.2f} | {memory:,.0f} |", flush=True)
    if options.gltfpack:
        seconds, memory, size = peer(options.gltfpack, folder)
        print(f"| {what} | gltfpack | {source:,} | {size:,} | {seconds:.2f} | {memory:,.0f} |", flush=True)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="+")
    parser.add_argument("--lodbake", type=Path, default=ROOT / "target/release/lodbake")
    parser.add_argument("--instances")
    parser.add_argument("--meshes", type=int, default=1000)
    parser.add_argument("--files", type=int, default=20000)
    parser.add_argument("--forms", default="nodes,gpu")
    parser.add_argument("--plain", action="store_true")
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--cell", type=float, default=32)
    parser.add_argument("--gltfpack", type=Path)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    options.lodbake = options.lodbake.resolve()
    what, forms = options.what, options.forms.split(",")
    numbers = lambda default: [int(n) for n in (options.instances or default).split(",")]
    if what[0] == "generate":
        folder = Path(what[2])
        if what[1] == "files":
            write_files(folder, options.files, options.plain)
        for count in numbers("1300" if what[1] == "one" else "1000000") if what[1] != "files" else []:
            shapes = [rock(s, 50, 50) for s in range(1)] if what[1] == "one" else [rock(s, 12, 16) for s in range(options.meshes)]
            write_scene(folder / f"{count}.glb", shapes, count, options.plain)
        return
    print("| scene | form | bytes in | bytes out | s | peak MiB |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        work = options.keep or Path(name)
        if what[0] == "files":
            write_files(work / "files/scenes", options.files, options.plain)
            measure(options, work / "files", f"{options.files:,} files", forms[:1])
            return
        before = {}
        for count in numbers("13,1300,130000" if what[0] == "one" else "1000000"):
            folder = work / f"{what[0]}{count}"
            shapes = [rock(0, 50, 50)] if what[0] == "one" else [rock(s, 12, 16) for s in range(options.meshes)]
            write_scene(folder / "scenes/scene.glb", shapes, count, options.plain)
            sizes = measure(options, folder, f"{count:,} instances of {len(shapes):,}", forms)
            for form, (many, size) in before.items():
                print(f"{form}: {(sizes[form] - size) / (count - many):.1f} bytes for each further instance")
            before = {form: (count, size) for form, size in sizes.items()}


if __name__ == "__main__":
    main()
