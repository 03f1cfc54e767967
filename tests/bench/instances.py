#!/usr/bin/env python3
"""What recovered instances save, beside other tools: meshes that are left, and bytes of scene and buffers, for each scene.

No tool simplifies here: lodbake bakes without levels (`min_triangles` above all meshes), glTF-Transform runs `dedup` and then
`instance`, gltfpack `-mi -noq -km` (no quantisation, materials kept; keeping names would turn `-mi` off). Images are not counted. "draws" are the
nodes with a mesh, with all instances: they must stay as many.

With `--split` lodbake alone runs, first without and then with `split = true`, as nodes and as batches; scenes without such parts are
left out.

    instances.py [--lodbake PATH] [--tools FOLDER_WITH_NODE_MODULES] [--recover KIND] [--split] FOLDER_OR_FILE..
"""

import argparse
import json
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def load(path):
    """The JSON of a scene, and the bytes of all that is geometry: the document and its buffers, without images in them."""
    data = path.read_bytes()
    size = len(data)
    if data[:4] == b"glTF":
        length = struct.unpack("<I", data[12:16])[0]
        document = json.loads(data[20 : 20 + length])
    else:
        document = json.loads(data)
    for buffer in document.get("buffers", []):
        uri = buffer.get("uri", "")
        if uri and not uri.startswith("data:"):
            size += (path.parent / uri.replace("%20", " ")).stat().st_size
    views = document.get("bufferViews", [])
    images = [views[image["bufferView"]]["byteLength"] for image in document.get("images", []) if "bufferView" in image]
    return document, size - sum(images)


def accessor_count(document, node):
    instancing = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
    if not instancing:
        return 1
    return min(document["accessors"][i]["count"] for i in instancing["attributes"].values())


def facts(path):
    """Different geometries that nodes show (by accessors), how often they are drawn, bytes."""
    document, size = load(path)
    shown, draws = set(), 0
    for node in document.get("nodes", []):
        if "mesh" in node:
            draws += accessor_count(document, node)
            for primitive in document["meshes"][node["mesh"]]["primitives"]:
                shown.add(json.dumps([primitive["attributes"], primitive.get("indices"), primitive.get("extensions")]))
    return len(shown), draws, size


def run(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr}")


def by_other(tool, program, source, work):
    """The scene as another tool writes it."""
    out = work / f"{tool}.glb"
    if tool == "gltfpack":
        run([program, "-i", source, "-o", out, "-mi", "-noq", "-km"])
    else:
        run([program, "dedup", source, work / "dedup.glb"])
        run([program, "instance", work / "dedup.glb", out])
    return out


def lodbake(program, source, work, recover, more=""):
    pipeline = work / "pipeline.toml"
    pipeline.write_text(
        f'input = "{source.parent}"\noutput = "out"\ninclude = "{source.name}"\n[simplify]\nmin_triangles = 4294967295\n'
        f'[appearance]\nrecord = false\n[instances]\nrecover = "{recover}"\n{more}\n'
    )
    began = time.perf_counter()
    run([program, "--no-cache", "--quiet", pipeline])
    seconds = time.perf_counter() - began
    report = json.loads((work / "out/report.json").read_text())
    found = [mesh["instance_of"] for mesh in report["scenes"][0]["meshes"] if mesh["instance_of"]]
    kinds = {}
    for instance in found:
        name = instance["kind"] + (" (kept)" if instance["kept"] else "")
        kinds[name] = kinds.get(name, 0) + 1
    residual = max((max(i["residual"].values()) for i in found if not i["kept"]), default=0)
    return work / "out" / source.name, kinds, residual, seconds


def parts(options, files):
    print("| scene | parts, different | nodes | residual | bytes without | nodes | batches | s without | s with |")
    print("|---|---|---|---|---|---|---|---|---|")
    for source in files:
        with tempfile.TemporaryDirectory() as name:
            work = Path(name)
            sizes, times, record = [], [], None
            for more in ("", "split = true", 'split = true\ninstancing = "gpu"'):
                baked, _, _, seconds = lodbake(options.lodbake.resolve(), source, work, options.recover, more)
                sizes.append(f"{load(baked)[1]:,}")
                times.append(f"{seconds:.2f}")
                found = json.loads((work / "out/report.json").read_text())["scenes"][0]["parts"]
                record = record or found
            if not record["groups"]:
                continue
            groups = record["groups"]
            residual = max(max(group["residual"].values()) for group in groups)
            count = sum(group["instances"] for group in groups)
            row = [source.name, f"{count}, {len(groups)}", str(record["nodes"]), f"{residual:.1e}", *sizes, *times[:2]]
            print("| " + " | ".join(row) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lodbake", type=Path, default=ROOT / "target/release/lodbake")
    parser.add_argument("--tools", type=Path, help="a folder whose node_modules has gltf-transform and gltfpack")
    parser.add_argument("--recover", default="similar")
    parser.add_argument("--split", action="store_true")
    parser.add_argument("scenes", type=Path, nargs="+")
    options = parser.parse_args()
    files = []
    for path in options.scenes:
        found = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.suffix in (".glb", ".gltf"))
        files += [p.resolve() for p in found]
    if options.split:
        parts(options, files)
        return
    tools = options.tools and options.tools.resolve() / "node_modules/.bin"
    print("| scene | source: geometries, draws, bytes | lodbake | found | residual | s | glTF-Transform | gltfpack |")
    print("|---|---|---|---|---|---|---|---|")
    for source in files:
        with tempfile.TemporaryDirectory() as name:
            work = Path(name)
            cell = lambda path: "{:,}, {:,}, {:,}".format(*facts(path))
            baked, kinds, residual, seconds = lodbake(options.lodbake.resolve(), source, work, options.recover)
            others = []
            for tool in ("gltf-transform", "gltfpack"):
                if not tools or not (tools / tool).exists():
                    others.append("")
                    continue
                try:
                    others.append(cell(by_other(tool, tools / tool, source, work)))
                except RuntimeError as error:
                    print(error, file=sys.stderr)
                    others.append("fails")
            words = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
            row = [source.name, cell(source), cell(baked), words, f"{residual:.1e}", f"{seconds:.2f}", *others]
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
