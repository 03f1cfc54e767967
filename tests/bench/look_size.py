#!/usr/bin/env python3
"""Do smaller pictures put levels in the order of the metric's 512 x 512? Bakes every scene below a folder at four ratios,
evaluates all levels at several sizes, and prints Spearman's rank correlation with 512 x 512.

    look_size.py [--lodbake PATH] FOLDER
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SIZES = [64, 128, 256, 512]
RATIOS = [0.5, 0.25, 0.1, 0.05]


def ranks(values):
    order = sorted(range(len(values)), key=lambda i: values[i])
    found = [0] * len(values)
    for rank, i in enumerate(order):
        found[i] = rank
    return found


def spearman(a, b):
    a, b = ranks(a), ranks(b)
    mean = (len(a) - 1) / 2
    return sum((x - mean) * (y - mean) for x, y in zip(a, b)) / sum((x - mean) ** 2 for x in a)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lodbake", default=ROOT / "target/release/lodbake")
    parser.add_argument("folder", type=Path)
    options = parser.parse_args()
    lodbake, folder = str(Path(options.lodbake).resolve()), options.folder.resolve()
    figures = {}
    with tempfile.TemporaryDirectory() as work:
        lod = ", ".join(f"{{ ratio = {ratio} }}" for ratio in RATIOS)
        text = f"input = {json.dumps(str(folder))}\noutput = 'out'\nlod = [{lod}]\nappearance.record = false\n"
        (Path(work) / "pipeline.toml").write_text(text)
        subprocess.run([lodbake, "--quiet", "--no-cache", "pipeline.toml"], cwd=work, check=True)
        for output in sorted(Path(work, "out").rglob("*.gl[bt]*")):
            source = folder / output.relative_to(Path(work, "out"))
            levels = [f"{output}@{level}" for level in range(1, len(RATIOS) + 1)]
            for size in SIZES:
                words = ["evaluate", "--json", "--samples", "50", "--size", str(size), str(source), *levels]
                run = subprocess.run([lodbake, *words], capture_output=True, text=True, check=True)
                for candidate in json.loads(run.stdout)["candidates"]:
                    figures.setdefault(candidate["name"], {})[size] = candidate["d_rms"]
    whole = [each[512] for each in figures.values()]
    for size in SIZES[:-1]:
        own = [each[size] for each in figures.values()]
        print(f"{size} x {size}: rank correlation {spearman(own, whole):.4f} over {len(own)} levels")


if __name__ == "__main__":
    main()
