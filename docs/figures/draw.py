# SPDX-License-Identifier: BSD-3-Clause
"""The drawings of the README and of docs/explanation: `python docs/figures/draw.py` writes them."""

import csv
from functools import partial
from pathlib import Path

import matplotlib
import numpy as np

import halfshell as hs
from halfshell.structures import alpha_quartz
from halfshell_report.findings import standings
from halfshell_report.rows import read_csv

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Circle, Rectangle
from mpl_toolkits.mplot3d.art3d import Line3DCollection

FOLDER = Path(__file__).parent
BLUE, ORANGE, RED, GREY, LIGHT = "tab:blue", "tab:orange", "tab:red", "0.45", "#dbe8f4"


def quartz():
    """The bonds of a block of alpha-quartz, and its g(r) by element."""
    fig = plt.figure(figsize=(7.0, 3.2), layout="constrained")
    left = fig.add_subplot(1, 2, 1, projection="3d")
    right = fig.add_subplot(1, 2, 2)
    points, box, species = alpha_quartz((3, 3, 2))
    i, _, D, S = hs.pairs(points, 2.0, box=box, quantities="ijDS")
    bonds = np.stack((points[i], points[i] + D), axis=1)[~S.any(axis=1)]
    left.add_collection(Line3DCollection(bonds, colors=GREY, linewidths=1.2))
    for name, size, colour in (("Si", 55, ORANGE), ("O", 28, RED)):
        left.scatter(*points[species == name].T, s=size, color=colour, depthshade=False)
    left.set_aspect("equal")
    left.set_axis_off()
    left.view_init(12, -82)
    left.set_box_aspect(None, zoom=1.6)

    points, box, species = alpha_quartz()
    moved = points + np.random.default_rng(0).normal(0.0, 0.06, points.shape)
    atoms = hs.Points(moved, types=species, box=box)
    result = hs.rdf(atoms, 6.0, bins=240, by_type=True)
    for a, b in (("Si", "O"), ("O", "O"), ("Si", "Si")):
        right.plot(result.r, result[a, b].g, label=f"{a}-{b}", linewidth=1.2)
    right.set(xlabel="r / Å", ylabel="g(r)", xlim=(1.0, 6.0), ylim=(0.0, 16.0))
    right.spines[["top", "right"]].set_visible(False)
    right.legend(frameon=False)
    return fig


def grid(ax, columns, rows, shaded=()):
    for x, y in shaded:
        ax.add_patch(Rectangle((x, y), 1, 1, color=LIGHT, linewidth=0))
    ax.hlines(range(rows + 1), 0, columns, color="0.7", linewidth=0.8)
    ax.vlines(range(columns + 1), 0, rows, color="0.7", linewidth=0.8)
    ax.set(xlim=(-0.1, columns + 0.1), ylim=(-0.1, rows + 0.1), aspect="equal")
    ax.set_axis_off()


def half_shell():
    """All neighbouring cells, and the half of them that suffices."""
    points = np.random.default_rng(5).random((75, 2)) * 5.0
    fig, axes = plt.subplots(1, 2, figsize=(8.0, 4.3), layout="constrained")
    full = [(x, y) for x in (1, 2, 3) for y in (1, 2, 3)]
    half = [(2, 2), (3, 2), (1, 3), (2, 3), (3, 3)]
    for ax, shaded, title in (
        (axes[0], full, "all neighbours: each pair is met twice"),
        (axes[1], half, "half of the shell: each pair is met once"),
    ):
        grid(ax, 5, 5, shaded)
        ax.add_patch(Rectangle((2, 2), 1, 1, fill=False, color=BLUE, linewidth=2))
        near = np.array([tuple(cell) in shaded for cell in points.astype(int).tolist()])
        ax.scatter(*points[~near].T, s=10, color="0.75")
        ax.scatter(*points[near].T, s=14, color=BLUE)
        ax.set_title(title, fontsize=10)
    for dx, dy in ((1, 0), (-1, 1), (0, 1), (1, 1)):
        axes[1].annotate(
            "", (2.5 + 0.95 * dx, 2.5 + 0.95 * dy), (2.5, 2.5),
            arrowprops={"arrowstyle": "->", "color": ORANGE, "linewidth": 1.8},
        )  # fmt: skip
    return fig


def stages():
    """Candidates that are gathered, what the filter leaves, and what is decided exactly."""
    rng = np.random.default_rng(3)
    group, points = 2.0 + rng.random((4, 2)), rng.random((170, 2)) * 5.0
    D = points[:, None] - group
    d = np.sqrt((D * D).sum(axis=2)).min(axis=1)
    gathered = ((points > 1.0) & (points < 4.0)).all(axis=1)
    band = 0.06  # a few millionths in truth
    fig, axes = plt.subplots(1, 3, figsize=(9.6, 4.0), layout="constrained")
    steps = (
        ("gather: points of cells in reach", gathered, np.zeros_like(gathered)),
        ("filter in float32: within, beyond,\nor too close to call", gathered & (d < 1.0 - band),
         gathered & (abs(d - 1.0) <= band)),
        ("exact: float64, two float64, integers", gathered & (d <= 1.0), np.zeros_like(gathered)),
    )  # fmt: skip
    for ax, (title, kept, unsure) in zip(axes, steps):
        grid(ax, 5, 5, [(x, y) for x in (1, 2, 3) for y in (1, 2, 3)] if ax is axes[0] else ())
        for centre in group if ax is not axes[0] else ():
            ax.add_patch(Circle(centre, 1.0, fill=False, color="0.8", linewidth=0.8))
        ax.scatter(*points[~kept & ~unsure].T, s=8, color="0.8")
        ax.scatter(*points[kept].T, s=14, color=BLUE)
        ax.scatter(*points[unsure].T, s=30, color=ORANGE)
        ax.scatter(*group.T, s=36, color="black", marker="x")
        ax.set_title(title, fontsize=10)
    return fig


def images():
    """A pair across a face, a pair with two images, and what S counts."""
    fig, ax = plt.subplots(figsize=(7.6, 1.9), layout="constrained")
    box, points = np.array([[4.0, 0.0], [1.0, 2.2]]), np.array([[1.3, 1.4], [4.0, 1.1]])
    for shift in (-1, 0, 1):
        at = shift * box[0]
        outline = np.array([at, at + box[0], at + box.sum(axis=0), at + box[1], at])
        own = shift == 0
        ax.plot(*outline.T, color=BLUE if own else "0.75", linewidth=2.0 if own else 0.8)
        ax.scatter(*(points + at).T, s=50, color=["black", ORANGE], alpha=1.0 if own else 0.35)
        name = "the box" if own else "image"
        ax.text(at[0] + 2.0, -0.35, name, ha="center", fontsize=9)
    for shift in (0, -1):
        end = points[1] + shift * box[0]
        ax.annotate("", end, points[0], arrowprops={"arrowstyle": "->", "color": RED})
        ax.text(end[0] - 0.1, 0.62, f"S = ({shift}, 0)", color=RED, ha="right", fontsize=9)
    ax.text(points[0, 0] + 0.05, points[0, 1] + 0.35, "i")
    ax.text(points[1, 0], points[1, 1] + 0.2, "j")
    ax.set(aspect="equal", ylim=(-0.6, 2.3))
    ax.set_axis_off()
    return fig


def levels():
    """Points of two sizes: one grid for the large, another for the small."""
    rng = np.random.default_rng(1)
    small = 0.2 + rng.random((60, 2)) * 5.6
    large = np.array([[1.6, 3.9], [4.3, 1.7]])
    fig, axes = plt.subplots(1, 2, figsize=(8.0, 4.3), layout="constrained")
    for ax, width, title in (
        (axes[0], 1.5, "large and small ones: wide cells"),
        (axes[1], 0.4, "small ones with each other: narrow cells"),
    ):
        lines = np.arange(0.0, 6.01, width)
        ax.hlines(lines, 0, 6, color="0.75", linewidth=0.7)
        ax.vlines(lines, 0, 6, color="0.75", linewidth=0.7)
        for centre in large if ax is axes[0] else ():
            ax.add_patch(Circle(centre, 1.3, fill=False, color=ORANGE, linewidth=2))
        for centre in small:
            ax.add_patch(Circle(centre, 0.2, fill=False, color=BLUE))
        ax.set(xlim=(-0.1, 6.1), ylim=(-0.1, 6.1), aspect="equal")
        ax.set_axis_off()
        ax.set_title(title, fontsize=10)
    return fig


def rows_of(path):
    with open(FOLDER.parents[1] / path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def bars(ax, lengths, labels, own, ink):
    """One bar a name, the first at the top, in ink that suits the page."""
    drawn = ax.barh(list(lengths), list(lengths.values()), color=[ORANGE if name in own else GREY
                                                                 for name in lengths])  # fmt: skip
    for name, text in zip(lengths, ax.bar_label(drawn, labels, padding=4, color=ink)):
        text.set_fontweight("bold" if name in own else "normal")
    ax.invert_yaxis()
    ax.tick_params(left=False, bottom=False, labelbottom=False, labelcolor=ink)
    ax.spines[:].set_visible(False)
    ax.margins(x=0.18, y=0.02)


def clear(fig):
    for patch in (fig.patch, *(ax.patch for ax in fig.axes)):
        patch.set_alpha(0.0)
    return fig


def times(ink):
    """The same list of pairs by nine libraries, each in the better of two measurements."""
    found = {}
    for path in TIMED:
        for row in rows_of(path):
            name, time = row["contestant"], 1e3 * float(row["fresh_median"])
            if row["scene"] == "pairs-1e5-k52" and "[" not in name:
                found[name] = min(time, found.get(name, time))
    found = dict(sorted(found.items(), key=lambda one: one[1]))
    fig, ax = plt.subplots(figsize=(5.6, 3.3), layout="constrained")
    bars(ax, found, [f"{time:,.0f} ms" for time in found.values()], ["halfshell"], ink)
    fig.suptitle("2.6 million pairs of 100,000 points, one thread", color=ink, fontsize=11)
    return clear(fig)


def ratios():
    """How many times as long the fastest other library takes, for searches of many kinds."""
    rows, faster, labels = rows_of(COMPARED), {}, []
    for scene, name in KINDS.items():
        mine = [row for row in rows if row["scene"] == scene and row["complete"] == "True"]
        *_, own = (row for row in mine if row["contestant"] == "halfshell")  # as the page's table
        others = [row for row in mine if not row["contestant"].startswith("halfshell")]
        best = min(others, key=lambda row: float(row["fresh_median"]))
        faster[name] = float(best["fresh_median"]) / float(own["fresh_median"])
        labels.append(f"{faster[name]:.1f}, {best['contestant']}")
    fig, ax = plt.subplots(figsize=(5.6, 5.0), layout="constrained")
    bars(ax, faster, labels, KINDS.values(), "black")
    ax.margins(x=0.5)
    ax.axvline(1.0, color="black", linewidth=0.8)
    fig.suptitle("time of the fastest other library / ours", fontsize=11)
    return clear(fig)


def errors():
    """What became of the scenes of the report, for each method."""
    with open(FOLDER.parent / "report" / "report.csv", newline="", encoding="utf-8") as file:
        _, rows = read_csv(file)
    standing = [one for one in standings(rows) if one.method not in ("double", "single", "float32")]
    names = ["halfshell" if one.method == "exact" else one.method for one in standing]
    parts = {
        "right": (BLUE, [one.right for one in standing]),
        "wrong": (RED, [one.wrong for one in standing]),
        "error, crash or\ntime-out": (ORANGE, [one.failed + one.late for one in standing]),
        "not offered": ("0.82", [one.not_offered for one in standing]),
    }
    fig, ax = plt.subplots(figsize=(5.6, 4.2), layout="constrained")
    start = np.zeros(len(names))
    for label, (colour, counts) in parts.items():
        ax.barh(names, counts, left=start, color=colour, label=label)
        start += counts
    ax.invert_yaxis()
    ax.tick_params(left=False)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_xlabel("scenes")
    fig.legend(loc="outside upper center", ncols=4, frameon=False, fontsize=9,
               columnspacing=1.0, handlelength=1.0)  # fmt: skip
    return clear(fig)


#: With all libraries, and with linkcell, which needs a newer Python.
TIMED = [f"benchmarks/results/amd-epyc/2026-11-{day}.csv" for day in (25, 27)]

#: What fills the tables of docs/performance.md, and what some of its scenes are.
COMPARED = "benchmarks/results/intel-xeon-vm/2026-11-26-2.csv"
KINDS = {
    "pairs-1e5-k52": "pairs of 100,000 points",
    "pairs-1e5-k419": "419 neighbours each",
    "vectors-1e5-k52": "with distances, vectors",
    "open-1e4": "10,000 points, no box",
    "triclinic-1e4-k52": "a triclinic box",
    "plane-1e5-k20": "a plane",
    "clusters-1e5": "dense clusters",
    "fcc-tie": "a crystal, cutoff on a shell",
    "rows-1e5-k52": "table of all neighbours",
    "between-1e5": "two sets",
    "nearest-1e5-periodic": "12 nearest",
    "count-1e5-k419": "numbers of pairs",
    "histogram-1e5-k419-100": "histogram, 100 bins",
    "batch-30": "2000 molecules of 30",
    "molecule-30": "30 points",
    "call-2": "2 points",
}

DRAWINGS = {
    "quartz": quartz, "half-shell": half_shell, "stages": stages, "images": images,
    "levels": levels, "times": partial(times, "#1f2328"), "times-dark": partial(times, "#e6edf3"),
    "ratios": ratios, "errors": errors,
}  # fmt: skip


def main(folder=FOLDER):
    settings = {"svg.hashsalt": "halfshell", "svg.fonttype": "path", "font.size": 10}
    for name, draw in DRAWINGS.items():
        with plt.rc_context(settings):
            fig = draw()
            fig.savefig(folder / f"{name}.svg", metadata={"Date": None})
            plt.close(fig)


if __name__ == "__main__":
    main()
