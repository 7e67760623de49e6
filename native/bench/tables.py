"""Turns what the benchmarks wrote into tables, plots and one JSON file.

tables.py kernel|joints RESULT.json [SUMMARY.json]
tables.py report RESULT.csv FOLDER
"""

import csv
import json
import platform
import statistics
import sys
from collections import defaultdict
from pathlib import Path

NANOSECONDS = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}


def markdown(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])


def runs(path):
    """(context, {name: {figure: value}}): of each benchmark the median and the extremes of its
    repetitions, in nanoseconds, and its counters."""
    result = json.loads(Path(path).read_text())
    times, counters = defaultdict(list), {}
    for run in result["benchmarks"]:
        if run["run_type"] != "iteration":
            continue
        name = run["run_name"].split("/")[0]
        times[name].append(run["real_time"] * NANOSECONDS[run["time_unit"]])
        counters[name] = run
    return result["context"], {
        name: dict(counters[name], median=statistics.median(t), low=min(t), high=max(t)) for name, t in times.items()
    }


def machine(context):
    return (
        f"{context['num_cpus']} cores, {context['instruction_set']}, "
        f"{float(context['multiply_adds_a_second']) / 1e9:.1f} thousand million multiply-adds a "
        f"second at most ({platform.machine()})"
    )


def kernel(path, summary=None):
    context, results = runs(path)
    figures = {}
    for name, run in results.items():
        if name.startswith("chain"):
            continue
        what, mesh, vertices, target, threads, state, frames = name.split("|")
        per_vertex = {key: run[key] / run["vertices"] / run["frames"] for key in ("median", "low", "high")}
        figures[what, mesh, int(vertices), target, int(threads), state, int(frames)] = {
            **per_vertex,
            "influences": run["influences"],
            "joints_a_block": run["joints_a_block"],
            "bytes": run["bytes_a_vertex"],
        }

    def of(*key):
        return figures.get(key, {}).get("median")

    rows, records = [], []
    for (what, mesh, vertices, target, threads, state, frames), own in sorted(
        figures.items(), key=lambda item: (item[0][0].startswith("build"), item[0][1:3], item[0][4:], item[0])
    ):
        if what.startswith(("bound", "report")):
            continue
        bound = [
            of(b, mesh, vertices, "-", threads, "warm" if state == "asleep" else state, 1)
            for b in ("bound", "bound, streamed")
        ]
        bound = min((b for b in bound if b), default=None)
        report = of("report", mesh, min(v for w, m, v, *_ in figures if m == mesh), "-", 1, "warm", 1)
        units = 12 * own["joints_a_block"] / (float(context["multiply_adds_a_second"]) / 1e9)
        record = {
            "what": what,
            "influences": own["influences"],
            "vertices": vertices,
            "instruction_set": target,
            "threads": threads,
            "state": state,
            "frames_a_call": frames,
            "ns_a_vertex": own["median"],
            "low": own["low"],
            "high": own["high"],
            "joints_a_block": own["joints_a_block"],
            "bytes_a_vertex": own["bytes"],
        }
        if not what.startswith("build"):
            if bound:
                record["of_memory_bound"] = bound / own["median"]
            if what == "linear" and target == context["instruction_set"]:
                record["of_multiply_add_bound"] = units / threads / own["median"]
            if report:
                record["times_faster_than_report"] = report / own["median"]
        records.append(record)
        rows.append(
            (
                what,
                f"{own['influences']:.2f}",
                f"{vertices:,}",
                target,
                threads,
                state + (f", {frames} frames a call" if frames > 1 else ""),
                f"{own['median']:.2f} ({own['low']:.2f}-{own['high']:.2f})",
                percent(record, "of_memory_bound"),
                percent(record, "of_multiply_add_bound"),
                f"{record['times_faster_than_report']:.0f}x" if "times_faster_than_report" in record else "",
            )
        )
    print(f"{machine(context)}\n")
    print(
        markdown(
            (
                "what",
                "influences",
                "vertices",
                "set",
                "threads",
                "state",
                "ns a vertex (extremes)",
                "of memory bound",
                "of multiply-add bound",
                "report's loop",
            ),
            rows,
        )
    )
    chain_rows, chain_records = chain(results)
    print("\nBefore and after skinning\n")
    print(
        markdown(
            ("what", "vertices", "threads", "milliseconds", "ns a vertex (and iteration)", "of memory bound"),
            chain_rows,
        )
    )
    write_summary(summary, context, records + chain_records)


def percent(record, key):
    return f"{100 * record[key]:.0f} %" if key in record else ""


def chain(results):
    """Rows and records of the benchmarks named "chain|...", beside their bounds."""
    rows, records = [], []
    for name, run in sorted(results.items()):
        if not name.startswith("chain|"):
            continue
        _, what, vertices, threads, steps = name.split("|")
        vertices, threads, steps = int(vertices), int(threads), int(steps)
        bound = results["chain bound" + name.removeprefix("chain")]["median"]
        record = {
            "what": what,
            "vertices": vertices,
            "threads": threads,
            "iterations": steps,
            "milliseconds": run["median"] / 1e6,
            "ns_a_vertex": run["median"] / vertices / steps,
            "of_memory_bound": bound / run["median"],
        }
        records.append(record)
        rows.append(
            (
                what,
                f"{vertices:,}",
                threads,
                f"{record['milliseconds']:.3f}",
                f"{record['ns_a_vertex']:.2f}",
                f"{100 * record['of_memory_bound']:.0f} %",
            )
        )
    return rows, records


def joints(path, summary=None):
    context, results = runs(path)
    by_tree = defaultdict(dict)
    for name, run in results.items():
        what, tree, count, frames, threads = name.split("|")
        key = (tree, int(count), int(frames))
        by_tree[key][what, int(threads)] = run["median"] / run["joints"] / run["frames"]
    most = max(threads for row in by_tree.values() for _, threads in row)
    records = [
        {
            "tree": tree,
            "joints": count,
            "frames": frames,
            "plain_loop_ns_a_joint": row["plain loop", 1],
            "one_thread": row["plain loop", 1] / row["sinew", 1],
            "all_threads": row["plain loop", 1] / row["sinew", most],
        }
        for (tree, count, frames), row in sorted(by_tree.items(), key=lambda i: (i[0][1:], i[0]))
    ]
    print(f"{machine(context)}; speed over the plain loop\n")
    print(
        markdown(
            ("tree", "joints", "frames", "plain loop, ns a joint", "one thread", f"{most} threads"),
            [
                (
                    r["tree"],
                    f"{r['joints']:,}",
                    f"{r['frames']:,}",
                    f"{r['plain_loop_ns_a_joint']:.1f}",
                    f"{r['one_thread']:.2f}x",
                    f"{r['all_threads']:.2f}x",
                )
                for r in records
            ],
        )
    )
    write_summary(summary, context, records)


def write_summary(path, context, records):
    if path:
        about = {key: context[key] for key in ("date", "num_cpus", "instruction_set", "multiply_adds_a_second")}
        Path(path).write_text(json.dumps({"machine": about, "results": records}, indent=1) + "\n")


PROGRAMS = ["report, serial", "report, TBB", "sinew", "sinew, 64 frames a call"]
COLOURS = dict(zip(PROGRAMS, ["#7f7f7f", "#d62728", "#1f77b4", "#17becf"]))
STAGES = ["pose", "forward kinematics", "skinning"]


def report(path, folder):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with open(path) as file:
        rows = [
            dict(
                row,
                threads=int(row["threads"]),
                calls=int(row["calls"]),
                wall=float(row["wall"]),
                cpu=float(row["cpu"]),
            )
            for row in csv.DictReader(file)
        ]
    rigs = list(dict.fromkeys(row["rig"] for row in rows))
    cores = max(row["threads"] for row in rows if row["experiment"] == "weak")

    def pick(**wanted):
        return [row for row in rows if all(row[key] == value for key, value in wanted.items())]

    plt.rcParams.update(
        {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.alpha": 0.3}
    )
    for experiment, axis, label in [("weak", "calls", "calls of skinning"), ("strong", "threads", "threads")]:
        figure, axes = plt.subplots(1, len(rigs), figsize=(4.6 * len(rigs), 3.6), layout="constrained")
        for ax, rig in zip(axes, rigs):
            for program in PROGRAMS:
                own = pick(experiment=experiment, rig=rig, program=program)
                style = dict(color=COLOURS[program], label=program)
                if experiment == "strong" and program == "report, serial":
                    ax.axhline(own[0]["wall"], linestyle="--", **style)
                else:
                    ax.plot([r[axis] for r in own], [r["wall"] for r in own], marker="o", markersize=3, **style)
            ax.set(title=rig, xlabel=label, ylabel="wall time, s", yscale="log")
            if experiment == "weak":
                ax.set_xscale("log", base=2)
            else:
                ax.axvspan(cores + 0.5, 8.5, color="#000", alpha=0.06, linewidth=0)
                ax.set_xlabel(f"threads (shaded: more than the {cores} cores)")
        axes[0].legend(fontsize=8)
        figure.savefig(folder / f"{experiment}_scaling.png", dpi=120)

    figure, axes = plt.subplots(1, len(rigs), figsize=(4.6 * len(rigs), 2.9), layout="constrained")
    shades = ["#fdbf6f", "#a6cee3", "#1f78b4"]
    for ax, rig in zip(axes, rigs):
        for y, program in enumerate(PROGRAMS[:3]):
            parts = [pick(experiment="loop", rig=rig, program=program, stage=stage)[0] for stage in STAGES]
            total, left = sum(part["wall"] for part in parts), 0
            for part, shade, stage in zip(parts, shades, STAGES):
                share = 100 * part["wall"] / total
                ax.barh(y, share, left=left, color=shade, label=stage if y == 0 else None)
                left += share
            ax.text(101, y, f"{1e3 * total / parts[0]['calls']:.3g} ms", va="center", fontsize=8)
        ax.set_title(rig, loc="left")
        ax.set(yticks=range(3), yticklabels=PROGRAMS[:3], xlabel="% of a frame's wall time", xlim=(0, 118))
        ax.grid(False)
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize=8, loc="upper center", ncol=3)
    figure.savefig(folder / "stages.png", dpi=120)

    lines = []
    for rig in rigs:
        lines.append(f"### {rig}\n")
        table = []
        for program in PROGRAMS:
            weak = max(pick(experiment="weak", rig=rig, program=program), key=lambda r: r["calls"])
            strong = pick(experiment="strong", rig=rig, program=program)
            one, best = strong[0], min(strong, key=lambda r: r["wall"])
            row = [
                program,
                f"{1e3 * weak['wall'] / weak['calls']:.4f}",
                f"{1e3 * weak['cpu'] / weak['calls']:.4f}",
                f"{one['wall']:.3f}",
                f"{best['wall']:.3f} ({best['threads']})",
            ]
            for figure_of in ("wall", "cpu"):
                parts = [pick(experiment="loop", rig=rig, program=program, stage=stage) for stage in STAGES]
                total = sum(part[0][figure_of] for part in parts if part)
                row.append(f"{100 * parts[2][0][figure_of] / total:.0f} %" if parts[2] else "")
            table.append(row)
        calls = pick(experiment="strong")[0]["calls"]
        lines.append(
            markdown(
                (
                    "program",
                    "a call: wall, ms",
                    "a call: CPU, ms",
                    f"{calls:,} calls, 1 thread, s",
                    "best of 1 to 8 threads, s",
                    "skinning's share, wall",
                    "share, CPU",
                ),
                table,
            )
            + "\n"
        )
    text = "\n".join(lines)
    (folder / "report.md").write_text(text)
    print(text)


if __name__ == "__main__":
    commands = {"kernel": kernel, "joints": joints, "report": report}
    commands[sys.argv[1]](*sys.argv[2:])
