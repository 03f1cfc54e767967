#!/usr/bin/env python3
"""Seconds that each effort takes for a chain of four levels, and how many times as long as `balanced` that is.

    presets.py [--lodbake PATH] [--rounds N] FILE..

Whole bakes without cache and without recorded looks, the efforts in turn; the least of the rounds, wall time and processor time.
Needs a release build (`cargo build --release`).
"""

import argparse
import json
import resource
import subprocess
import tempfile
import time
from pathlib import Path

EFFORTS = ["fast", "balanced", "best"]
RATIOS = [0.5, 0.25, 0.1, 0.05]


def bake(lodbake, source, effort, folder):
    """(wall seconds, processor seconds) of one bake."""
    lod = ", ".join(f"{{ ratio = {ratio} }}" for ratio in RATIOS)
    lines = [
        f"input = {json.dumps(str(source.parent))}",
        f"include = [{json.dumps(source.name)}]",
        "output = 'out'",
        f"lod = [{lod}]",
        "appearance.record = false",
        f"simplify.effort = '{effort}'",
    ]
    (folder / "pipeline.toml").write_text("\n".join(lines) + "\n")
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([lodbake, "--quiet", "--no-cache", "pipeline.toml"], cwd=folder, check=True)
    took, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return took, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lodbake", default="target/release/lodbake", type=Path)
    parser.add_argument("--rounds", default=2, type=int)
    parser.add_argument("files", nargs="+", type=Path)
    options = parser.parse_args()
    lodbake = options.lodbake.resolve()
    print("| file | " + " | ".join(f"{effort}: wall s (CPU s), of balanced" for effort in EFFORTS) + " |")
    print("|---" * (len(EFFORTS) + 1) + "|")
    for source in (file.resolve() for file in options.files):
        least = {effort: (float("inf"), float("inf")) for effort in EFFORTS}
        for _ in range(options.rounds):
            for effort in EFFORTS:
                with tempfile.TemporaryDirectory() as folder:
                    took = bake(lodbake, source, effort, Path(folder))
                least[effort] = tuple(map(min, least[effort], took))
        wall, cpu = least["balanced"]
        cells = (f"{w:.2f} ({c:.2f}), {w / wall:.1f} ({c / cpu:.1f})" for w, c in least.values())
        print(f"| {source.stem} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
