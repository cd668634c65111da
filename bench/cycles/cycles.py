# SPDX-License-Identifier: Apache-2.0
"""Time to equal error of our light transport and Blender Cycles, on a scene both can express."""

import argparse
import array
import itertools
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import bench_support as bench

FOLDER = pathlib.Path(__file__).resolve().parent
OURS = bench.BIN / "bench_our_transport"
HEAD = bench.SOURCE / "examples/cylinder_head/cylinder_head.glb"

# Pixels x, y, width, height from the top left corner. Small: their references are converged further.
CROPS = {"top face": (100, 92, 130, 11), "cam trough": (50, 45, 40, 17), "port": (184, 162, 20, 16)}
REGIONS = ["whole image", "off edges", *CROPS]
EDGE = 0.15  # pixels with a neighbour that differs by more are at edges

# Name, kind, what is varied, its values from fast to exact, and the program's other options. Cycles'
# samples are the ruler: the others are compared with its times to the same error.
RULER = "Cycles"
CONTENDERS = [
    (RULER, "cycles", "--samples", [8, 16, 32, 64, 128, 256], []),
    ("Cycles, its roulette", "cycles", "--samples", [16, 64], ["--default-roulette"]),
    ("Cycles, adaptive", "cycles", "--adaptive", [0.05, 0.02, 0.01], ["--samples", "1024"]),
    ("ours, filter", "ours", "--noise", [0.08, 0.04, 0.02, 0.01], ["--filter", "1", "--max-samples", "4096"]),
    ("ours, no filter", "ours", "--noise", [0.08, 0.04, 0.02], ["--filter", "0", "--max-samples", "4096"]),
]


class Picture:
    """Grey values, bottom row first as in the file."""

    def __init__(self, path):
        magic, size, _, data = path.read_bytes().split(b"\n", 3)
        if magic != b"Pf":
            sys.exit(f"{path}: not a grey PFM")
        self.columns, self.rows = (int(n) for n in size.split())
        self.values = array.array("f", data)

    def crop(self, x, y, width, height):
        values = array.array("f")
        for row in range(self.rows - y - height, self.rows - y):
            start = row * self.columns + x
            values.extend(self.values[start:start + width])
        return values


def run(command, marker):
    """The JSON the program prints after the marker."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=3600, check=False)
    for line in done.stdout.splitlines():
        if done.returncode == 0 and line.startswith(marker):
            return json.loads(line.removeprefix(marker))
    sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout[-1000:]}{done.stderr[-1000:]}")


def render(kind, image, options, args):
    common = ["--threads", str(args.threads), "--image", str(image), *options]
    if kind == "ours":
        return run([str(OURS), "--glb", str(HEAD), *common], "")
    command = [
        "blender", "-b", "--factory-startup", "--python-exit-code", "1", "--python", str(FOLDER / "scene.py"), "--",
        str(image.parent),
    ]
    return run([*command, *common], "cycles: ")


def mean(values):
    return math.fsum(values) / len(values)


def mean_square_difference(a, b):
    return math.fsum((x - y) * (x - y) for x, y in zip(a, b)) / len(a)


def surfaces(picture, ambient):
    """Indices of pixels that see the part, with no edge next to them."""
    v, columns = picture.values, picture.columns
    inside = []
    for row in range(1, picture.rows - 1):
        for i in range(row * columns + 1, (row + 1) * columns - 1):
            if abs(v[i] - ambient) < 1e-5 * ambient:
                continue
            near = [v[i + d + e] for d in (-columns, 0, columns) for e in (-1, 0, 1)]
            if max(near) - v[i] < EDGE * v[i] and v[i] - min(near) < EDGE * v[i]:
                inside.append(i)
    return inside


class References:
    """What every region shows: mean of both programs' converged images."""

    def __init__(self, folder, args):
        ambient = json.loads((folder / "scene.json").read_text(encoding="utf-8"))["ambient_radiance_w_m2_sr"]
        ours, theirs = self.pair(folder, "whole", args.reference_samples, [], args)
        both = Picture(folder / "whole_ours.pfm")
        both.values = self.middle(ours, theirs)
        self.off_edges = surfaces(both, ambient)
        pairs = {"whole image": (ours, theirs)}
        pairs["off edges"] = tuple(self.off_edge_pixels(image) for image in (ours, theirs))
        for name, crop in CROPS.items():
            options = ["--crop", *(str(n) for n in crop)]
            pairs[name] = self.pair(folder, name, args.crop_samples, options, args)
        self.values = {name: self.middle(*pair) for name, pair in pairs.items()}
        self.mean = {name: mean(values) for name, values in self.values.items()}
        # Both are unbiased and independent: their mean has a quarter of their difference's variance.
        self.variance = {name: mean_square_difference(*pair) / 4 for name, pair in pairs.items()}
        self.agreement = [
            {
                "region": name,
                "pixels": len(a),
                "mean_radiance_w_m2_sr": self.mean[name],
                "ours_over_cycles": mean(a) / mean(b),
                "standard_error": 2 * math.sqrt(self.variance[name] / len(a)) / self.mean[name],
                "reference_error_relative": math.sqrt(self.variance[name]) / self.mean[name],
            }
            for name, (a, b) in pairs.items()
        ]

    @staticmethod
    def middle(a, b):
        return array.array("f", ((x + y) / 2 for x, y in zip(a, b)))

    @staticmethod
    def pair(folder, name, samples, options, args):
        stem = name.replace(" ", "_")
        images = []
        for kind in ("ours", "cycles"):
            path = folder / f"{stem}_{kind}.pfm"
            more = ["--samples", str(samples)]
            if kind == "ours":
                more = ["--filter", "0", "--noise", "0", "--max-samples", str(samples), "--first-samples", "256"]
            render(kind, path, ["--seed", "1000", *more, *options], args)
            images.append(Picture(path))
        if len(images[0].values) != len(images[1].values):
            sys.exit(f"{name}: the images differ in size")
        return tuple(image.values for image in images)

    def off_edge_pixels(self, values):
        return array.array("f", (values[i] for i in self.off_edges))

    def errors(self, picture):
        """Per region, relative: mean square, without what the reference itself is off, and mean."""
        seen = {"whole image": picture.values, "off edges": self.off_edge_pixels(picture.values)}
        for name, crop in CROPS.items():
            seen[name] = picture.crop(*crop)
        square = {
            name: (mean_square_difference(values, self.values[name]) - self.variance[name]) / self.mean[name] ** 2
            for name, values in seen.items()
        }
        return square, {name: mean(values) / self.mean[name] - 1 for name, values in seen.items()}


def ruler_time(ruler, region, error):
    """Cycles' CPU time to an error, log-log between its measurements; and whether beyond them."""
    points = sorted((row["error"][region], row["cpu_s"]) for row in ruler)
    beyond = not points[0][0] <= error <= points[-1][0]
    k = next((i for i in range(1, len(points)) if error <= points[i][0]), len(points) - 1)
    (e0, t0), (e1, t1) = points[k - 1], points[k]
    if beyond:
        e0, t0 = points[0] if error < points[0][0] else points[-1]
        slope = -2  # of independent samples
    else:
        slope = math.log(t1 / t0) / math.log(e1 / e0)
    return t0 * (error / e0) ** slope, beyond


def measure(folder, references, args):
    rows = [
        {"contender": name, "setting": f"{option.strip('-')} {value}", "kind": kind, "runs": [],
         "options": [option, str(value), *more]}
        for name, kind, option, values, more in CONTENDERS for value in values
    ]
    # Programs take turns, fast settings first.
    ladders = [[row for row in rows if row["contender"] == name] for name, *_ in CONTENDERS]
    turns = [row for step in itertools.zip_longest(*ladders) for row in step if row is not None]
    for turn in range(args.rounds):
        for row in turns:
            image = folder / "image.pfm"
            result = render(row["kind"], image, [*row["options"], "--seed", str(turn + 1)], args)
            result["square_error"], result["bias"] = references.errors(Picture(image))
            row["runs"].append(result)
    for row in rows:
        for key in ("cpu_s", "wall_s", "load_s"):
            row[key] = mean([r[key] for r in row["runs"]])
        row["error"] = {
            region: math.sqrt(max(mean([r["square_error"][region] for r in row["runs"]]), 1e-12))
            for region in REGIONS
        }
        row["bias"] = {region: mean([r["bias"][region] for r in row["runs"]]) for region in REGIONS}
    ruler = [row for row in rows if row["contender"] == RULER]
    for row in rows:
        if row["contender"] == RULER:
            continue
        row["times_faster"] = {}
        row["beyond_ruler"] = []
        for region in REGIONS:
            their_s, beyond = ruler_time(ruler, region, row["error"][region])
            row["times_faster"][region] = their_s / row["cpu_s"]
            if beyond:
                row["beyond_ruler"].append(region)
    return rows


def print_agreement(references):
    print(f"{'region':<14}{'pixels':>8}{'mean':>9}{'ours/Cycles':>13}{'s.e.':>9}{'reference off by':>18}")
    for row in references.agreement:
        print(f"{row['region']:<14}{row['pixels']:>8}{row['mean_radiance_w_m2_sr']:>9.5f}"
              f"{row['ours_over_cycles']:>13.5f}{row['standard_error']:>9.5f}"
              f"{100 * row['reference_error_relative']:>17.2f}%")


def print_rows(rows):
    print(f"{'':<22}{'setting':<15}{'CPU s':>7}{'wall s':>8}{'load s':>8}  "
          + "".join(f"{region:>18}" for region in REGIONS))
    for row in rows:
        cells = []
        for region in REGIONS:
            cell = f"{100 * row['error'][region]:.2f} %"
            if "times_faster" in row:
                sign = "~" if region in row["beyond_ruler"] else ""
                cell += f" {'(' + sign + format(row['times_faster'][region], '.2g') + 'x)':>8}"
            else:
                cell += 9 * " "
            cells.append(f"{cell:>18}")
        print(f"{row['contender']:<22}{row['setting']:<15}{row['cpu_s']:>7.1f}{row['wall_s']:>8.1f}"
              f"{row['load_s']:>8.2f}  " + "".join(cells))


def print_bias(rows):
    for row in rows:
        cells = "".join(f"{100 * row['bias'][region]:>+16.2f} %" for region in REGIONS)
        print(f"{row['contender']:<22}{row['setting']:<38}  {cells}")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--reference-samples", type=int, default=512, help="a power of two")
    parser.add_argument("--crop-samples", type=int, default=8192, help="of the small regions' references")
    args = parser.parse_args()
    bench.print_machine()
    if shutil.which("blender") is None:
        print("skipped: no Blender")
        return
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([str(OURS), "--glb", str(HEAD), "--scene", str(folder)], check=True)
        references = References(folder, args)
        print_agreement(references)
        rows = measure(folder, references, args)
    load = os.getloadavg()[1]
    warning = ": too high for wall times" if load > args.threads + 0.5 else ""
    print(f"\nRoot mean square error relative to the region's mean; in brackets CPU time of \"{RULER}\" to that\n"
          f"error over own (~: beyond its ladder). {args.threads} threads, {args.rounds} rounds, load average of the "
          f"last 5 minutes {load:.1f}{warning}.")
    print_rows(rows)
    print("\nMean of the region against the reference:")
    print_bias(rows)
    results = {"agreement": references.agreement, "rows": rows, "load_average_5min": load}
    bench.write_results(args.json, "cycles", results)


if __name__ == "__main__":
    main()
