#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Pictures of docs/proof.md from the CSV files of the programs beside this one:
plot.py CSV_FOLDER PICTURE_FOLDER. Derived numbers only, no recordings."""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np


def read(folder, name):
    path = os.path.join(folder, name)
    if not os.path.exists(path):
        print(f"skipped: no {path}")
        return None
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    columns = rows[0]
    values = np.array([[float(x) for x in row] for row in rows[1:]])
    return {name: values[:, i] for i, name in enumerate(columns)}


def save(figure, folder, name):
    figure.tight_layout()
    figure.savefig(os.path.join(folder, name), dpi=90)
    plt.close(figure)


def focus(data, out):
    figure, (top, bottom) = plt.subplots(
        2, 1, figsize=(7.5, 6.5), sharex=True, height_ratios=[2, 1])
    x = 1e3 * data["distance_m"]
    held = data["held_out"] == 1
    y = data["observed_px"]
    top.plot(x[~held], y[~held], "k.", label="measured, fitted")
    top.plot(x[held], y[held], "o", mfc="none", mec="k", ms=4, label="measured, held out")
    for name, colour in [
        ("nominal", "tab:red"),
        ("focus + spherical", "tab:orange"),
        ("focus + f-number + blur", "tab:blue"),
        ("calibrated f: focus + blur", "tab:green"),
    ]:
        top.plot(x, data[name], color=colour, label=name)
        bottom.plot(x, y - data[name], color=colour)
    bottom.set_ylim(-0.65, 0.4)
    bottom.axhline(0, color="k", lw=0.5)
    bottom.set_xlabel("distance / mm")
    bottom.set_ylabel("measured - model / px")
    top.set_ylabel("width of the edge 2a / px")
    top.legend()
    save(figure, out, "real_focus_curve.png")


def exposure(data, out):
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8))
    for axis, of, title in [(axes[0], 0, "1 ms against 10 ms"), (axes[1], 2, "50 ms against 10 ms")]:
        for half, style in [(0, "k."), (1, "k+")]:
            at = (data["of"] == of) & (data["held_out"] == half)
            axis.errorbar(data["x"][at], data["y"][at] - data["linear"][at], data["sigma"][at],
                          fmt=style, ms=5, lw=0.8,
                          label="held out" if half else "fitted tiles")
        at = (data["of"] == of) & (data["held_out"] == 0)
        for name, colour in [("linear", "tab:red"), ("exponent", "tab:orange"),
                             ("power change", "tab:purple"), ("offset", "tab:blue"),
                             ("offset + exposure offset", "tab:green")]:
            axis.plot(data["x"][at], data[name][at] - data["linear"][at], color=colour, label=name)
        axis.set_title(title)
        axis.set_xlabel("mean at 10 ms / DN")
        axis.set_ylabel("mean - what proportion gives / DN")
    axes[1].legend(fontsize=8)
    save(figure, out, "real_exposure_series.png")


def multiline(data, out):
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True)
    models = [("offset + even light on board + halo in lens", "tab:red"),
              ("offset + even light on board + halo on board", "tab:blue"),
              ("offset + even light + both halos", "tab:green")]
    for axis, pose in zip(axes, [4, 68]):
        for held, style in [(0, "."), (1, "+")]:
            for paper, colour in [(True, "0.5"), (False, "k")]:
                at = ((data["pose"] == pose) & (data["held_out"] == held)
                      & ((data["reflectance"] > 0.6) == paper))
                axis.plot(data["distance_px"][at], data["observed_dn"][at], style, color=colour,
                          label=("board" if paper else "printed circles") if held == 0 else None)
        for name, colour in models:
            for paper in [True, False]:
                at = ((data["pose"] == pose) & (data["held_out"] == 0)
                      & ((data["reflectance"] > 0.6) == paper))
                axis.plot(data["distance_px"][at], data[name][at], color=colour,
                          label=name.replace("offset + ", "") if paper else None)
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_title(f"pose {pose}")
        axis.set_xlabel("distance from the nearest line / px")
    axes[0].set_ylabel("mean / DN")
    axes[1].legend(fontsize=7)
    save(figure, out, "real_multiline_laser.png")


def vignetting(data, out):
    figure, axis = plt.subplots(figsize=(6, 3.8))
    axis.plot(data["radius_px"], data["observed"], "k.", label="measured (authors' polynomial)")
    for name in list(data)[3:]:
        axis.plot(data["radius_px"], data[name], label=name)
    axis.set_xlabel("distance from the image's centre / px")
    axis.set_ylabel("relative signal")
    axis.legend(fontsize=7)
    save(figure, out, "real_vignetting.png")


def main():
    source, out = sys.argv[1:3]
    for name, draw in [("focus_curve.csv", focus), ("exposure_series.csv", exposure),
                       ("multiline_laser.csv", multiline), ("vignetting.csv", vignetting)]:
        data = read(source, name)
        if data is not None:
            draw(data, out)


if __name__ == "__main__":
    main()
