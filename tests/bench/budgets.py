#!/usr/bin/env python3
"""What a budget for the whole scene is worth: the scene's d_RMS from its 24 views, with one ratio for every mesh and with
`scene_triangles`, at the number of triangles that the ratio drew.

Each level is baked by itself: where a mesh skips a level, `FILE@1` would show its next one. Files without a level are left out.

    budgets.py [--lodbake PATH] [--ratios 0.5,0.25,0.1] [--size 256] [--cache DIR] FOLDER_OR_FILE..
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def run(words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, words))}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


def baked(options, cache, source, folder, level):
    """The scene with one level, and what its report says."""
    folder.mkdir()
    (folder / "pipeline.toml").write_text(
        f'input = "{source.parent}"\noutput = "out"\ninclude = "{source.name}"\ncache = "{cache}"\n'
        f"[appearance]\nrecord = false\n[[lod]]\n{level}\n"
    )
    run([options.lodbake, "--quiet", folder / "pipeline.toml"])
    return folder / "out" / source.name, json.loads((folder / "out/report.json").read_text())


def compared(options, cache, source, work, ratio):
    """d_RMS and triangles of both, and the number of distinct meshes with levels; `None` where there is nothing to share."""
    one, report = baked(options, cache, source, work / f"one{ratio}", f"ratio = {ratio}")
    meshes = [mesh for mesh in report["scenes"][0]["meshes"] if mesh["levels"]]
    kinds = {tuple(piece["hash"] for piece in mesh["pieces"]) for mesh in meshes}
    drawn = report["totals"]["triangles_drawn"]
    if len(drawn) < 2 or not kinds:
        return None
    shared, _ = baked(options, cache, source, work / f"all{ratio}", f"scene_triangles = {drawn[1]}")
    judge = [options.lodbake, "--json", "evaluate", "--renderer", "cpu", "--size", options.size, "--samples", 1000]
    both = json.loads(run([*judge, source, f"{one}@1", f"{shared}@1"]))["candidates"]
    return [(candidate["d_rms"], candidate["triangles"]) for candidate in both], len(kinds)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lodbake", type=Path, default=ROOT / "target/release/lodbake")
    parser.add_argument("--ratios", default="0.5,0.25,0.1")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--cache", type=Path, help="kept between runs; default: none is")
    parser.add_argument("scenes", type=Path, nargs="+")
    options = parser.parse_args()
    options.lodbake = options.lodbake.resolve()
    files = []
    for path in options.scenes:
        found = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.suffix in (".glb", ".gltf"))
        files += [p.resolve() for p in found]
    print("| scene | meshes | ratio | triangles | one ratio | triangles | scene budget | change |")
    print("|---|---|---|---|---|---|---|---|")
    logs = []
    for source in files:
        with tempfile.TemporaryDirectory() as name:
            work = Path(name)
            cache = options.cache.resolve() if options.cache else work / "cache"
            for ratio in options.ratios.split(","):
                try:
                    result = compared(options, cache, source, work, ratio)
                except (RuntimeError, json.JSONDecodeError) as error:
                    print(f"{source.name}: {error}", file=sys.stderr)
                    break
                if result is None:
                    print(f"{source.name}: no levels", file=sys.stderr)
                    break
                [(a, drawn), (b, left)], kinds = result
                # One mesh has nobody to share with.
                if 1 < kinds and a > 0 and b > 0:
                    logs.append(math.log(b / a))
                change = f"{100 * (b / a - 1):+.0f} %" if a > 0 else ""
                print(
                    f"| {source.stem} | {kinds} | {ratio} | {drawn:,} | {a:.2f} | {left:,} | {b:.2f} | {change} |",
                    flush=True,
                )
    if logs:
        below = sum(log < 0 for log in logs)
        print(f"\n{below} of {len(logs)} below one ratio, geometric mean {math.exp(sum(logs) / len(logs)):.3f}")


if __name__ == "__main__":
    main()
