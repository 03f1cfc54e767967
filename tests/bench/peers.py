#!/usr/bin/env python3
"""Times lodbake against gltfpack (npm) on the same files and prints the ratios as a Markdown table.

lodbake bakes the chain of four levels in one run: cold cache, one thread. gltfpack makes one level a run, so it runs four times
with `-noq -kn -si R` (no quantisation, names kept: the same work). Seconds are user + system of the whole process, and wall;
memory is the largest resident set (of the largest of gltfpack's runs). Each number is the median of N runs, taken in turn.

    peers.py [--runs N] [--lodbake PATH] FILE..
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RATIOS = [0.5, 0.25, 0.1, 0.05]
MEBIBYTE = 1024 * 1024


class Cost:
    """What one process, or several one after the other, took."""

    def __init__(self, cpu_secs, wall_secs, peak_bytes):
        self.cpu_secs, self.wall_secs, self.peak_bytes = cpu_secs, wall_secs, peak_bytes

    def __add__(self, other):
        peak = max(self.peak_bytes, other.peak_bytes)
        return Cost(self.cpu_secs + other.cpu_secs, self.wall_secs + other.wall_secs, peak)


def measured(command, cwd):
    """Runs `command` and reads what the kernel counted for that child: the numbers of `/usr/bin/time -v`."""
    began = time.perf_counter()
    child = subprocess.Popen(command, cwd=cwd, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    errors = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    wall = time.perf_counter() - began
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {child.returncode}\n{errors.decode(errors='replace')}")
    return Cost(usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss * 1024)


def run_gltfpack(gltfpack, source, folder):
    """One level a run, as its users do."""
    total = Cost(0, 0, 0)
    for ratio in RATIOS:
        command = ["node", str(gltfpack), "-i", str(source), "-o", str(folder / f"{ratio}.glb")]
        total += measured([*command, "-noq", "-kn", "-si", str(ratio)], folder)
    return total


def run_lodbake(lodbake, source, folder):
    """The whole chain, nothing cached."""
    levels = "".join(f"[[lod]]\nratio = {ratio}\n" for ratio in RATIOS)
    (folder / "scenes").mkdir()
    for file in source.parent.iterdir():
        if file.is_file():
            (folder / "scenes" / file.name).symlink_to(file)
    include = f'include = ["{source.name}"]\n'
    (folder / "pipeline.toml").write_text(f'input = "scenes"\noutput = "baked"\n{include}\n{levels}')
    return measured([str(lodbake), "--quiet", "--jobs", "1", "pipeline.toml"], folder)


def medians(costs):
    return Cost(*(statistics.median(getattr(cost, name) for cost in costs) for name in ("cpu_secs", "wall_secs", "peak_bytes")))


def spread(costs):
    """Half the range of the CPU time, in per cent of its median."""
    seconds = [cost.cpu_secs for cost in costs]
    return 50 * (max(seconds) - min(seconds)) / statistics.median(seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--runs", type=int, default=5, help="runs of each program on each file (default 5)")
    parser.add_argument("--lodbake", type=Path, default=ROOT / "target/release/lodbake", help="default: target/release/lodbake")
    parser.add_argument("--gltfpack", type=Path, default=ROOT / "tests/clients/node_modules/gltfpack/cli.js")
    options = parser.parse_args()
    for needed in (options.lodbake, options.gltfpack, *options.files):
        if not needed.exists():
            sys.exit(f"not found: {needed} (a release build, and `npm ci` in tests/clients, must come first)")

    programs = {
        "gltfpack": lambda source, folder: run_gltfpack(options.gltfpack.resolve(), source, folder),
        "lodbake": lambda source, folder: run_lodbake(options.lodbake.resolve(), source, folder),
    }
    print("| file | gltfpack ×4: CPU s · wall s · MiB | lodbake, 4 levels: CPU s · wall s · MiB | CPU ratio | wall ratio | memory ratio |")
    print("|---|---|---|---|---|---|")
    for file in options.files:
        costs = {name: [] for name in programs}
        for _ in range(options.runs):  # in turn, so that a slow minute of the machine meets both
            for name, program in programs.items():
                folder = Path(tempfile.mkdtemp(prefix="lodbake-peers-"))
                costs[name].append(program(file.resolve(), folder))
                shutil.rmtree(folder)
        peer, own = medians(costs["gltfpack"]), medians(costs["lodbake"])
        cells = [f"{c.cpu_secs:.2f} ±{spread(costs[n]):.0f} % · {c.wall_secs:.2f} · {c.peak_bytes / MEBIBYTE:.0f}" for n, c in (("gltfpack", peer), ("lodbake", own))]
        ratios = [own.cpu_secs / peer.cpu_secs, own.wall_secs / peer.wall_secs, own.peak_bytes / peer.peak_bytes]
        print("| " + " | ".join([file.name, *cells, *(f"{ratio:.2f}" for ratio in ratios)]) + " |", flush=True)
    print(f"\nmedian of {options.runs} runs; ratios below 1: lodbake takes less")


if __name__ == "__main__":
    main()
