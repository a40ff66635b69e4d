#!/usr/bin/env python3
"""Writes a scene of many photographs from one of few, to measure what grows with them.

    python3 -m venv venv && venv/bin/pip install pillow
    venv/bin/python scripts/photo-scene.py castle/bundle.out OUT --copies 10 --pixels 12e6

Reads a Bundler scene with its list.txt, and writes one of --copies times as many photographs with poses jittered by
--jitter of the distance between neighbors, the first copy as it is. With --pixels photographs are scaled to so many
and saved as JPEG, each a file of its own; without, copies are links to the photographs.
"""

import argparse
import math
import os
import random
from pathlib import Path


def read_scene(path):
    lines = path.read_text().split("\n")
    count = int(lines[1].split()[0])
    cameras = []
    for index in range(count):
        rows = [[float(v) for v in line.split()] for line in lines[2 + 5 * index : 7 + 5 * index]]
        cameras.append(rows)
    names = path.with_name("list.txt").read_text().split("\n")
    return cameras, [line.split()[0] for line in names if line.strip()]


def center_of(camera):
    rotation, shift = camera[1:4], camera[4]
    return [-sum(rotation[k][i] * shift[k] for k in range(3)) for i in range(3)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--copies", type=int, default=2)
    parser.add_argument("--pixels", type=float)
    parser.add_argument("--jitter", type=float, default=0.1)
    args = parser.parse_args()
    cameras, names = read_scene(args.bundle)
    centers = [center_of(camera) for camera in cameras]
    nearest = [min(math.dist(a, b) for b in centers if b is not a) for a in centers]
    step = args.jitter * sorted(nearest)[len(nearest) // 2]
    args.output.mkdir(parents=True, exist_ok=True)
    chance = random.Random(1)
    text, listed = [], []
    for index, (camera, name) in enumerate(zip(cameras, names)):
        source = args.bundle.parent / name
        scale, picture = 1.0, None
        if args.pixels:
            from PIL import Image

            picture = Image.open(source)
            scale = math.sqrt(args.pixels / (picture.width * picture.height))
            picture = picture.resize((round(picture.width * scale), round(picture.height * scale)))
        for copy in range(args.copies):
            file = f"{copy:02}_{index:03}.jpg"
            target = args.output / file
            if picture is not None:
                picture.save(target, quality=92)
            else:
                target.unlink(missing_ok=True)
                os.symlink(source.resolve(), target)
            rotation, shift = camera[1:4], list(camera[4])
            if copy > 0:
                moved = [step * chance.uniform(-1, 1) for _ in range(3)]
                shift = [shift[k] - sum(rotation[k][i] * moved[i] for i in range(3)) for k in range(3)]
            text.append(f"{camera[0][0] * scale} 0 0")
            text += [" ".join(map(str, row)) for row in [*rotation, shift]]
            listed.append(file)
    (args.output / "bundle.out").write_text("\n".join([f"# Bundle file v0.3", f"{len(listed)} 0", *text]) + "\n")
    (args.output / "list.txt").write_text("\n".join(listed) + "\n")


if __name__ == "__main__":
    main()
