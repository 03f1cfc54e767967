#!/usr/bin/env python3
"""Looks of lodbake's levels beside those of other tools, at the triangle count that each tool reached.

    looks.py [options] FOLDER_OR_FILE..

Every tool simplifies every asset of one mesh or few (`.glb`, `.gltf` below the folders) to 1/2, 1/4, 1/10 and 1/20, once: its
files and figures are kept in `--work` and used again. Then lodbake bakes, for each preset, the counts that the tools reached,
and `lodbake evaluate` (512 x 512, 24 views) tells d_RMS of all. A cell is one asset at one ratio: the largest of
`d_RMS of lodbake / d_RMS of the tool` over the tools, each at its own count; below 1: closer to the source than every tool.
Scenes of several meshes are asked for a share of each mesh. Tools: `studies/README.md` tells how to install them.
"""

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
RATIOS = [0.5, 0.25, 0.1, 0.05]
# Tools, and how cells name them.
PEERS = {"gltfpack -se 1": "gs", "gltfpack": "gl", "glTF-Transform": "gT", "MeshLab": "Me", "Blender": "Bl"}
# Counts closer than this are one level.
SAME = 0.01
# Scenes of fewer triangles are left out: a twentieth of them is nothing to look at.
LEAST = 300


def command(peer, source, out, ratio, tools):
    node, python = tools / "node_modules/.bin", tools / "venv/bin/python"
    if peer == "glTF-Transform":
        return [node / "gltf-transform", "simplify", source, out, "--ratio", ratio, "--error", "1"]
    if peer.startswith("gltfpack"):
        return [node / "gltfpack", "-i", source, "-o", out, "-si", ratio, "-noq", "-kn", *peer.split()[1:]]
    return [python, HERE / f"{peer.lower()}.py", source, out, ratio]


def run(words, **more):
    return subprocess.run(["nice", "-n", "5", *map(str, words)], capture_output=True, text=True, **more)


def evaluate(options, source, candidates, size=512):
    words = [options.lodbake, "evaluate", "--json", "--samples", "50", "--size", size, source, *candidates]
    done = run(words)
    if done.returncode:
        raise RuntimeError(f"evaluate {source}: {done.stderr.strip()[-500:]}")
    return json.loads(done.stdout)


def peer_figures(options, asset):
    """{ratio: {peer: {triangles, d_rms} or {error}}}, and the source's triangles."""
    source, folder = asset["source"], options.work / "peers" / asset["name"]
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "figures.json"
    known = json.loads(record.read_text()) if record.exists() else {}
    fresh = []
    for ratio in RATIOS:
        for peer in PEERS:
            key = f"{peer} {ratio}"
            if key in known:
                if options.measure_again and "file" in known[key]:
                    fresh.append((key, known[key]["file"]))
                continue
            out = folder / f"{peer.replace(' ', '')}-{ratio}.glb"
            try:
                done = run(command(peer, source, out, ratio, options.tools), timeout=600)
                problem = None if out.exists() and done.returncode == 0 else (done.stderr or done.stdout).strip()[-200:]
            except subprocess.TimeoutExpired:
                problem = "more than 600 s"
            if problem is not None or not out.exists():
                known[key] = {"error": problem or "no output"}
            else:
                fresh.append((key, out))
    if fresh:
        for key, out in fresh:
            try:
                figures = evaluate(options, source, [out])
                found = figures["candidates"][0]
                known[key] = {"triangles": found["triangles"], "d_rms": found["d_rms"], "file": str(out)}
                known["source"] = figures["reference"]["triangles"]
            except RuntimeError as error:
                known[key] = {"error": str(error)[-200:]}
        record.write_text(json.dumps(known, indent=1))
    return known


def wanted_counts(figures, draft):
    """The counts that the tools reached, each level once, finest first."""
    if draft:
        return [round(figures["source"] * ratio) for ratio in RATIOS]
    counts = sorted({f["triangles"] for f in figures.values() if isinstance(f, dict) and f.get("triangles")}, reverse=True)
    kept = []
    for count in counts:
        if count <= 0.9 * figures["source"] and (not kept or abs(kept[-1] - count) > SAME / 2 * count):
            kept.append(count)
    return kept


def bake(options, asset, preset, counts, source_triangles):
    """Levels at those counts: [(triangles, d_rms)], and the seconds that it took."""
    folder = options.work / "own" / options.label / preset / asset["name"]
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    source = asset["source"]
    lod = ", ".join(f"{{ ratio = {count / source_triangles!r} }}" for count in counts)
    text = f"input = {json.dumps(str(source.parent))}\ninclude = [{json.dumps(source.name)}]\noutput = 'out'\nlod = [{lod}]\n"
    text += "appearance.record = false\n" + "".join(line + "\n" for line in options.set)
    text += f"simplify.effort = '{preset}'\n"
    (folder / "pipeline.toml").write_text(text)
    began = time.perf_counter()
    done = run([options.lodbake, "--quiet", "--no-cache", "pipeline.toml"], cwd=folder)
    took = time.perf_counter() - began
    if done.returncode:
        raise RuntimeError(f"{asset['name']}: {done.stderr.strip()[-500:]}")
    output = folder / "out" / source.name
    names = [f"{output}@{level}" for level in range(1, len(counts) + 1)]
    levels = []
    # Levels that repeat the one before them are not there.
    while names:
        try:
            levels = [(c["triangles"], c["d_rms"]) for c in evaluate(options, source, names, 256 if options.draft else 512)["candidates"]]
            break
        except RuntimeError:
            names.pop()
    return levels, took


def cells(figures, levels):
    """{ratio: (cell, peer that sets it, its d_rms, ours)}; the level of a tool is the one nearest in count."""
    out = {}
    for ratio in RATIOS:
        found = []
        for peer in PEERS:
            figure = figures.get(f"{peer} {ratio}", {})
            # A tool that gave up on the asset made no level.
            if not figure.get("triangles") or not figure["d_rms"] or figure["triangles"] > 0.9 * figures["source"]:
                continue
            triangles, own = min(levels, key=lambda level: abs(level[0] - figure["triangles"]))
            # Levels of few triangles cannot be closer than one contraction.
            is_fair = -max(2, SAME * triangles) <= triangles - figure["triangles"] <= SAME * figure["triangles"]
            found.append((own / figure["d_rms"] if is_fair else math.nan, peer, figure["d_rms"], own, triangles))
        fair = [entry for entry in found if not math.isnan(entry[0])]
        if fair:
            out[ratio] = max(fair)
    return out


def mean(values):
    values = list(values)
    return math.exp(sum(map(math.log, values)) / len(values)) if values else math.nan


def assets(paths):
    files = []
    for path in paths:
        files += [path] if path.is_file() else sorted(f for f in path.rglob("*") if f.suffix in (".glb", ".gltf"))
    for file in files:
        name = file.parent.name if file.stem in ("model", "scene") or file.parent.name == file.stem else file.stem
        yield {"name": name, "source": file.resolve()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--lodbake", type=Path, default=ROOT / "target/release/lodbake")
    parser.add_argument("--tools", type=Path, required=True, help="folder with node_modules and venv")
    parser.add_argument("--work", type=Path, required=True, help="folder for files and figures, kept between runs")
    parser.add_argument("--presets", default="fast,balanced,best")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="line for pipeline.toml")
    parser.add_argument("--label", default="now", help="name of this run's files")
    parser.add_argument("--against", help="label of an earlier run to compare with, cell by cell")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--draft", action="store_true", help="the four ratios alone, in pictures of 256 x 256: quick, rough")
    parser.add_argument("--measure-again", action="store_true", help="figures of the tools' files that are there, anew")
    parser.add_argument("--peers-only", action="store_true")
    options = parser.parse_args()
    options.lodbake, options.work, options.tools = options.lodbake.resolve(), options.work.resolve(), options.tools.resolve()
    found = []
    for asset in assets(options.paths):
        figures = peer_figures(options, asset)
        if figures.get("source", 0) >= LEAST:
            found.append((asset, figures))
    if options.peers_only:
        return
    for preset in options.presets.split(","):
        def one(pair):
            asset, figures = pair
            counts = wanted_counts(figures, options.draft)
            levels, took = bake(options, asset, preset, counts, figures["source"])
            return cells(figures, levels), took

        began = time.perf_counter()
        with ThreadPoolExecutor(options.threads) as pool:
            results = list(pool.map(one, found))
        print(f"\n{preset}: d_RMS against the best tool at its own count")
        print("| asset | " + " | ".join(f"1/{round(1 / ratio)}" for ratio in RATIOS) + " | all | s |")
        print("|---|" + "---|" * (len(RATIOS) + 2))
        table = {}
        for (asset, _), (row, took) in zip(found, results):
            table[asset["name"]] = {str(ratio): row[ratio][0] for ratio in row}
            shown = [f"{row[r][0]:.3f} {PEERS[row[r][1]]}" if r in row else "–" for r in RATIOS]
            print(f"| {asset['name']} | " + " | ".join(shown) + f" | {mean(c[0] for c in row.values()):.3f} | {took:.1f} |")
        by_ratio = [mean(row[r][0] for row, _ in results if r in row) for r in RATIOS]
        every = [cell[0] for row, _ in results for cell in row.values()]
        print("| geometric mean | " + " | ".join(f"{m:.3f}" for m in by_ratio) + f" | {mean(every):.3f} | {time.perf_counter() - began:.0f} |")
        print(f"worst {max(every):.3f}; above 0.9: {sum(c > 0.9 for c in every)}, above 1: {sum(c > 1 for c in every)} of {len(every)}")
        record = options.work / "own" / options.label / f"{preset}.json"
        record.write_text(json.dumps(table, indent=1))
        if options.against:
            before = json.loads((options.work / "own" / options.against / f"{preset}.json").read_text())
            changes = [(table[a][r] / before[a][r], a, r) for a in table for r in table[a] if r in before.get(a, {})]
            print(f"against {options.against}: {mean(c[0] for c in changes):.4f};", end=" ")
            by_asset = {a: mean(c[0] for c in changes if c[1] == a) for a in table}
            print(", ".join(f"{a} {m:.3f}" for a, m in by_asset.items()))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
