#!/usr/bin/env python3
"""How long `lodbake check` takes beside `git status`, on the same tree of many scenes with a warm cache.

    cargo build --release && tests/bench/check.py target/release/lodbake [--files 2000] [--rounds 15] [--keep DIR]

Makes a tree of small scenes (each with a name of its own inside, so that no two files
are equal), bakes it once, then runs both in turn and prints medians, and the ratio of the medians with its spread.
"""
import argparse
import json
import os
import pathlib
import resource
import statistics
import struct
import subprocess
import tempfile
import time

PIPELINE = """input = "scenes"
output = "out"

[appearance]
record = false

[[budget]]
triangles = { warn = 30000, error = 50000 }
d_rms = { error = 20 }
file_bytes = { error = 20000000 }
draw_calls = 100
"""


def grid(side, name):
    """A GLB with one square of side × side cells: small, so that the bake is not what takes the time here."""
    n = side + 1
    positions = b"".join(struct.pack("<3f", i / side, j / side, 0.05 * ((i * 7 + j * 3) % 5)) for j in range(n) for i in range(n))
    indices = []
    for j in range(side):
        for i in range(side):
            a = j * n + i
            indices += [a, a + 1, a + n + 1, a, a + n + 1, a + n]
    faces = struct.pack(f"<{len(indices)}H", *indices)
    faces += b"\0" * (-len(faces) % 4)
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": n * n, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0.2]},
            {"bufferView": 1, "componentType": 5123, "count": len(indices), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(faces)},
        ],
        "buffers": [{"byteLength": len(positions) + len(faces)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(positions) + len(faces), b"BIN\0") + positions + faces
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def make(folder, files):
    for number in range(files):
        place = folder / "scenes" / f"set {number // 100:02}"
        place.mkdir(parents=True, exist_ok=True)
        (place / f"part {number:04}.glb").write_bytes(grid(10 + number % 8, f"part {number}"))
    (folder / "pipeline.toml").write_text(PIPELINE)
    (folder / ".gitignore").write_text("out\n.lodbake\n")


def timed(words, folder):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    done = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    seconds = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert done.returncode == 0, f"{words}: exit code {done.returncode}\n{done.stdout[-2000:]}"
    return seconds, cpu, done.stdout


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lodbake", type=pathlib.Path)
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--keep", type=pathlib.Path, help="use and keep this folder")
    arguments = parser.parse_args()
    lodbake = str(arguments.lodbake.resolve())
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        if not (folder / "pipeline.toml").exists():
            folder.mkdir(parents=True, exist_ok=True)
            make(folder, arguments.files)
            timed(["git", "init", "-q"], folder)
            timed(["git", "add", "."], folder)
            timed(["git", "-c", "user.name=a", "-c", "user.email=a@example.org", "commit", "-qm", "scenes"], folder)
            time.sleep(1.1)  # files as young as an index are looked at again, by git and by lodbake
            timed([lodbake, "-q"], folder)
        commands = {"git status": ["git", "status", "--short"], "lodbake check": [lodbake, "check"]}
        times = {name: [] for name in commands}
        cpus = {name: [] for name in commands}
        for words in commands.values():
            said = timed(words, folder)[2]
            print("  ".join(words[-2:]), "|", (said.strip().splitlines() or ["(clean)"])[-1])
        for _ in range(arguments.rounds):
            for name, words in commands.items():
                seconds, cpu, _ = timed(words, folder)
                times[name].append(seconds)
                cpus[name].append(cpu)
        for name, all_times in times.items():
            median, cpu = 1000 * statistics.median(all_times), 1000 * statistics.median(cpus[name])
            print(f"{name:14} median {median:7.1f} ms   fastest {1000 * min(all_times):7.1f} ms   processor {cpu:7.1f} ms")
        ratios = [b / a for a, b in zip(*times.values())]
        medians = [statistics.median(all_times) for all_times in times.values()]
        low, high = statistics.quantiles(ratios, n=4)[::2]
        print(f"ratio of the medians {medians[1] / medians[0]:.2f} (middle half of {arguments.rounds} rounds: {low:.2f} to {high:.2f}), "
              f"{arguments.files} files, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
        cpu = [statistics.median(all_cpus) for all_cpus in cpus.values()]
        print(f"ratio of processor time {cpu[1] / cpu[0]:.2f}")


if __name__ == "__main__":
    main()
