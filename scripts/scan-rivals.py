#!/usr/bin/env python3
"""Reads scans by surfel and by other readers, in turn, and prints what each read and how long it took.

    python3 -m venv venv && venv/bin/pip install numpy laspy lazrs pye57
    venv/bin/python scripts/scan-rivals.py --surfel target/release/surfel --scans FOLDER

Every number of every point is compared first: `surfel export` writes what surfel read as PLY, in the order of the file,
and numpy compares that with what laspy and pye57 give. Times are of tiles of the files autzen_trim.laz and
pumpAVisualReferenceImage.e57 of FOLDER: medians of --rounds rounds, surfel and the others in turn, each in a process of
its own, the file in the cache of the system. PDAL has no wheels for Linux; where its module is installed it is timed too.
"""

import argparse
import json
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

LAS_NAMES = {
    "intensity": "intensity",
    "return": "return_number",
    "returns": "number_of_returns",
    "scan_direction": "scan_direction_flag",
    "edge_of_line": "edge_of_flight_line",
    "class": "classification",
    "user_data": "user_data",
    "point_source": "point_source_id",
    "time": "gps_time",
    "infrared": "nir",
}
PLY_TYPES = {
    "uchar": "u1", "char": "i1", "ushort": "<u2", "short": "<i2", "uint": "<u4", "int": "<i4",
    "float": "<f4", "double": "<f8",
}


def read_ply(path):
    """The vertices of a binary PLY file as a structured array."""
    with open(path, "rb") as file:
        fields, count = [], 0
        for line in iter(file.readline, b"end_header\n"):
            words = line.decode().split()
            if words[:2] == ["element", "vertex"]:
                count = int(words[2])
            elif words[0] == "property":
                fields.append((words[2], PLY_TYPES[words[1]]))
        return np.fromfile(file, dtype=np.dtype(fields), count=count)


def exported(surfel, path, folder):
    out = Path(folder) / "export.ply"
    subprocess.run([surfel, "export", path, "-o", out], check=True, capture_output=True)
    return read_ply(out)


def compare_las(surfel, path, folder):
    """Compares every number; returns names of what differs, and the number of points and of fields."""
    import laspy

    las, own = laspy.read(path), exported(surfel, path, folder)
    differs, fields = [], 0
    if len(las.points) != len(own):
        return [f"{len(own)} points, laspy {len(las.points)}"], len(own), 0
    for axis, scale, offset in zip("xyz", las.header.scales, las.header.offsets):
        fields += 1
        steps = np.round((own[axis] - offset) / scale).astype(np.int64)
        if not np.array_equal(steps, np.asarray(las[axis.upper()], dtype=np.int64)):
            differs.append(axis)
    known = set(las.point_format.dimension_names)
    for name in own.dtype.names[3:]:
        if name in ("nx", "ny", "nz"):
            continue
        fields += 1
        if name in ("red", "green", "blue"):
            theirs = np.asarray(las[name])
            deep = max(np.max(las[c]) for c in ("red", "green", "blue")) > 255
            # Eight bits, rounded.
            theirs = np.round(theirs / 257.0) if deep else theirs
            same = np.max(np.abs(own[name].astype(int) - theirs.astype(int)), initial=0) <= int(deep)
        elif name == "scan_angle":
            rank = "scan_angle_rank" in known
            theirs = np.asarray(las["scan_angle_rank" if rank else "scan_angle"], dtype=np.float64)
            same = np.allclose(own[name], theirs if rank else theirs * 0.006, atol=1e-9)
        elif name == "class_flags":
            bits = ["synthetic", "key_point", "withheld"] + (["overlap"] if "overlap" in known else [])
            theirs = sum(np.asarray(las[bit]).astype(int) << at for at, bit in enumerate(bits))
            same = np.array_equal(own[name], theirs)
        else:
            theirs = LAS_NAMES.get(name, name)
            if theirs == "classification":
                theirs = np.asarray(las[theirs])
            elif theirs in known:
                theirs = np.asarray(las[theirs])
            else:
                other = [k for k in known if re.sub(r"\W", "_", k).lower() == name.lower()]
                column = re.fullmatch(r"(.*)_(\d+)", name)
                if other:
                    theirs = np.asarray(las[other[0]])
                elif column and column[1] in known:
                    theirs = np.asarray(las[column[1]])[:, int(column[2])]
                elif "ExtraBytes" in known:
                    # laspy reads one record of extra bytes; those of a second one are bytes without a name to it.
                    theirs = np.asarray(las["ExtraBytes"])
                else:
                    differs.append(f"{name} is not known to laspy")
                    continue
            same = np.array_equal(own[name].astype(np.float64), theirs.astype(np.float64), equal_nan=True)
        if not same:
            differs.append(name)
    return differs, len(own), fields


def compare_e57(surfel, path, folder):
    import pye57

    file, own = pye57.E57(str(path)), exported(surfel, path, folder)
    differs, start = [], 0
    columns = {"x": "cartesianX", "y": "cartesianY", "z": "cartesianZ"}
    columns |= {"red": "colorRed", "green": "colorGreen", "blue": "colorBlue", "intensity": "intensity"}
    columns |= {"row": "rowIndex", "column": "columnIndex"}
    for scan in range(file.scan_count):
        data = file.read_scan(scan, ignore_missing_fields=True, intensity=True, colors=True, row_column=True)
        count = len(data["cartesianX"])
        part = own[start : start + count]
        start += count
        for ours, theirs in columns.items():
            if theirs not in data or ours not in own.dtype.names:
                continue
            a, b = part[ours].astype(np.float64), np.asarray(data[theirs], dtype=np.float64)
            # Places are in single precision about an origin.
            near = np.max(np.abs(b), initial=1.0) * 2.0**-22 if ours in "xyz" or ours == "intensity" else 0.0
            if len(a) != len(b) or np.max(np.abs(a - b), initial=0.0) > near:
                differs.append(ours)
    if start != len(own):
        differs.append(f"{len(own)} points, pye57 {start}")
    return differs, len(own), len(columns)


READERS = {
    # Arrays of places as doubles and of every field.
    "laspy": """
import laspy
las = laspy.read(path)
arrays = [las.x.copy(), las.y.copy(), las.z.copy()]
arrays += [numpy.array(las[name]) for name in las.point_format.dimension_names if name not in ('X', 'Y', 'Z')]
""",
    "laspy lazrs parallel": """
import laspy
las = laspy.read(path, laz_backend=laspy.LazBackend.LazrsParallel)
arrays = [las.x.copy(), las.y.copy(), las.z.copy()]
arrays += [numpy.array(las[name]) for name in las.point_format.dimension_names if name not in ('X', 'Y', 'Z')]
""",
    "lazrs parallel alone": """
import laspy
las = laspy.read(path, laz_backend=laspy.LazBackend.LazrsParallel)
""",
    "pye57": """
import pye57
file = pye57.E57(path)
scans = [file.read_scan(i, ignore_missing_fields=True, intensity=True, colors=True, row_column=True)
         for i in range(file.scan_count)]
""",
    "pdal": """
import pdal
pipeline = pdal.Reader(path).pipeline()
pipeline.execute()
arrays = pipeline.arrays
""",
}


def timed_reader(name, path):
    """Seconds of reading, without imports, and the largest memory of the process in bytes."""
    body = READERS[name]
    imports = "\n".join(line for line in body.splitlines() if line.startswith("import"))
    code = (
        f"import numpy, resource, time\npath = {str(path)!r}\n{imports}\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\nstart = time.perf_counter()\n"
        f"{body}\nprint(time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)"
    )
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    seconds, memory = out.split()
    return float(seconds), int(memory)


def timed_surfel(surfel, path):
    """Seconds of reading and of the tree, the largest memory, and the bytes of points with all that they carry."""
    child = subprocess.Popen(
        [surfel, "info", "--json", "--point-normals", "file", path], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    text = child.stdout.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise RuntimeError(f"surfel info {path}: exit code {child.returncode}")
    facts = json.loads(text)
    carried = sum(
        facts["vertices"] * int(found[1])
        for part in facts["parts"]
        if (found := re.search(r"(\d+) bytes? a point$", part["note"])) and part["name"].startswith("attribute")
    )
    kept = facts["memory_bytes"]["vertices"] + facts["memory_bytes"]["leaves"] + carried
    return facts["load_ms"] / 1e3, facts["build_ms"] / 1e3, usage.ru_maxrss * 1024, kept


def tile_las(source, path, points):
    import laspy

    las = laspy.read(source)
    count = len(las.points)
    tiles = -(-points // count)
    side = int(np.ceil(np.sqrt(tiles)))
    wide = (las.header.maxs - las.header.mins)[:2]
    steps = np.ceil(wide / las.header.scales[:2]).astype(np.int64) + 100
    with laspy.open(path, mode="w", header=las.header) as out:
        for tile in range(tiles):
            record = las.points.copy()
            record["X"] = las.X + steps[0] * (tile % side)
            record["Y"] = las.Y + steps[1] * (tile // side)
            out.write_points(record)
    return tiles * count


def tile_e57(source, path, points):
    import pye57

    file = pye57.E57(str(source))
    data = file.read_scan(0, ignore_missing_fields=True, intensity=True, colors=True)
    tiles = -(-points // len(data["cartesianX"]))
    many = {name: np.tile(np.asarray(values), tiles) for name, values in data.items()}
    many["cartesianX"] = many["cartesianX"] + 6.0 * np.repeat(np.arange(tiles), len(data["cartesianX"]))
    out = pye57.E57(str(path), mode="w")
    out.write_scan_raw(many)
    out.close()
    return len(many["cartesianX"])


def race(title, surfel, path, count, rivals, rounds):
    """Prints the times of a file: A B A B, medians."""
    times = {name: [] for name in ["surfel", "surfel with its tree", *rivals]}
    memory = {}
    kept = 0
    for _ in range(rounds):
        for name in ["surfel", *rivals]:
            if name == "surfel":
                read, build, most, kept = timed_surfel(surfel, path)
                times["surfel"].append(read)
                times["surfel with its tree"].append(read + build)
                memory["surfel with its tree"] = most
            else:
                seconds, memory[name] = timed_reader(name, path)
                times[name].append(seconds)
    print(f"\n{title}: {count:,} points, {os.path.getsize(path) / 1e6:.0f} MB, median of {rounds}")
    own = statistics.median(times["surfel"])
    for name, all_times in times.items():
        median = statistics.median(all_times)
        line = f"  {name:<22} {median:7.2f} s {count / median / 1e6:7.2f} M points/s  {median / own:5.2f} times surfel"
        if name in memory:
            line += f"  {memory[name] / 1e6:6.0f} MB at most"
        print(line)
    most = memory["surfel with its tree"]
    print(f"  memory of surfel: {most / kept:.2f} times the {kept / 1e6:.0f} MB of points, attributes and leaves")


def has_module(name):
    return subprocess.run([sys.executable, "-c", f"import {name}"], capture_output=True).returncode == 0


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--surfel", required=True, help="the program, built with --release")
    options.add_argument("--scans", required=True, type=Path, help="folder of scans")
    options.add_argument("--rounds", type=int, default=3)
    options.add_argument("--points", type=int, default=20_000_000, help="points of the tiled LAS and LAZ files")
    options.add_argument("--e57-points", type=int, default=5_000_000)
    options.add_argument("--folder", help="where tiles are made, and kept; default: a temporary one")
    options.add_argument("--no-race", action="store_true", help="compare numbers only")
    args = options.parse_args()
    surfel = os.path.abspath(args.surfel)
    with tempfile.TemporaryDirectory(prefix="scan-rivals-") as temporary:
        folder = Path(args.folder or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        is_equal = True
        for path in sorted(args.scans.iterdir()):
            compare = {".las": compare_las, ".laz": compare_las, ".e57": compare_e57}.get(path.suffix.lower())
            if compare is None:
                continue
            differs, points, fields = compare(surfel, path, folder)
            is_equal &= not differs
            verdict = "equal" if not differs else "DIFFERS: " + ", ".join(differs)
            print(f"{path.name:<42} {points:>9,} points, {fields:>2} fields: {verdict}", flush=True)
        if args.no_race:
            return 0 if is_equal else 1
        more = ["pdal"] if has_module("pdal") else []
        if not more:
            print("PDAL: no module here (its package has no wheels); not timed")
        for ending, rivals in [("las", ["laspy"]), ("laz", ["laspy lazrs parallel", "lazrs parallel alone"])]:
            path = folder / f"tiles-{args.points}.{ending}"
            count = 0
            if path.exists():
                import laspy

                with laspy.open(path) as file:
                    count = file.header.point_count
            else:
                count = tile_las(args.scans / "autzen_trim.laz", path, args.points)
            race(ending.upper(), surfel, path, count, rivals + more, args.rounds)
        path = folder / f"tiles-{args.e57_points}.e57"
        count = tile_e57(args.scans / "pumpAVisualReferenceImage.e57", path, args.e57_points)
        race("E57", surfel, path, count, ["pye57"] + more, args.rounds)
    return 0 if is_equal else 1


if __name__ == "__main__":
    sys.exit(main())
