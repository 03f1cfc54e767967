#!/usr/bin/env python3
"""How far a graphics card's figures are from the reference's: d_RMS of three levels of every asset, by both renderers.

    tests/bench/renderers.py LODBAKE [--size 256] [FOLDER]

FOLDER holds one folder for each asset (default: `quality` of $LODBAKE_CORPUS). Without a card, Mesa's Vulkan driver will do.
Prints a line for each asset and the largest relative and absolute difference of all.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PIPELINE = 'input = "{input}"\ninclude = ["{name}"]\noutput = "out"\ncache = "cache"\n[appearance]\nrecord = false\n'


def scene_of(folder):
    found = sorted(p for p in folder.rglob("*") if p.suffix in (".glb", ".gltf"))
    return found[0] if found else None


def measured(lodbake, renderer, size, scene, levels):
    began = time.time()
    command = [lodbake, "evaluate", "--json", "--samples", "1000", "--size", str(size), "--renderer", renderer, scene]
    done = subprocess.run([*command, *levels], stdout=subprocess.PIPE, check=True, text=True)
    record = json.loads(done.stdout)
    return [c["d_rms"] for c in record["candidates"]], time.time() - began, record["renderer"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lodbake")
    parser.add_argument("folder", nargs="?", default=Path(os.environ.get("LODBAKE_CORPUS", "../shared/corpus")) / "quality")
    parser.add_argument("--size", type=int, default=256)
    args = parser.parse_args()
    lodbake = str(Path(args.lodbake).resolve())
    worst = [0.0, 0.0]
    for folder in sorted(Path(args.folder).iterdir()):
        scene = scene_of(folder)
        if scene is None:
            continue
        with tempfile.TemporaryDirectory() as work:
            pipeline = Path(work) / "pipeline.toml"
            pipeline.write_text(PIPELINE.format(input=scene.parent.resolve(), name=scene.name))
            subprocess.run([lodbake, "-q", str(pipeline)], check=True)
            baked = scene_of(Path(work) / "out")
            levels = [f"{baked}@{level}" for level in (1, 2, 3)]
            cpu, cpu_time, _ = measured(lodbake, "cpu", args.size, str(scene), levels)
            gpu, gpu_time, name = measured(lodbake, "gpu", args.size, str(scene), levels)
        pairs = [f"{a:.4f} {b:.4f} ({100 * (b / a - 1):+.3f} %)" for a, b in zip(cpu, gpu)]
        worst[0] = max([worst[0]] + [abs(b / a - 1) for a, b in zip(cpu, gpu)])
        worst[1] = max([worst[1]] + [abs(b - a) for a, b in zip(cpu, gpu)])
        print(f"{folder.name:20} {'   '.join(pairs)}   {cpu_time:.1f} s, {gpu_time:.1f} s  {name}", flush=True)
    print(f"largest difference: {100 * worst[0]:.3f} % and {worst[1]:.4f}")


if __name__ == "__main__":
    sys.exit(main())
