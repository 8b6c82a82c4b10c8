#!/usr/bin/python3
"""Runs the scripts bench-* and draw-errors with programs that only print results: their tables, charts, kept results and messages.

Exits with 77 if Matplotlib is not installed.
"""

import importlib.util
import json
import os
import pathlib
import runpy
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED = 77
SOURCES = ("photons", "paths", "both")
CHARTS = {"bench-fit": ("fit-time", "fit-bytes"), "bench-mixtures": ("slices", "alignment", "reduction"), "bench-product": ("product-time",),
          "bench-training": ("training-likelihood", "training-nev", "training-sources"), "bench-vertices": ("vertex-nev", "reduction-nev")}
# Writes down its calls. With FAILURE, it fails with this message.
BENCHMARK = """#!/bin/bash
echo "$0 $*" >>{calls}
[ -z "$FAILURE" ] || {{ echo "$FAILURE" >&2; exit 3; }}
cat "$0.json"
"""

sys.dont_write_bytecode = True


def of_fits():
    numbers = ("nev_median", "nev_worst", "seconds", "bytes", "components", "records", "ratio_median", "ratio_p90")
    ways = ("wem", "eq8", "ceres", *(f"auto:{quality}" for quality in ("0.005", "0.01", "0.02", "0.03", "0.06", "0.12", "0.25")))
    return [{"lobe": lobe, "way": way} | {key: 1 + i for key in numbers} for lobe in ("ggx 0.1", "ggx 0.1x0.4") for i, way in enumerate(ways)]


def of_mixtures():
    nev = {"median": 0.1, "p90": 0.2}
    return {"slices": [{"surface": "gold", "elevation": 30, "y": [0, 1], "target": [1, 2], "fit": [1, 2]}],
            "alignment": [{"surface": "gold", "records": count, "aligned": nev, "not_aligned": nev} for count in (8, 16)],
            "reduction": [{"threshold": 0.1, "components": 8, "cost": cost, "nev": 0.1, "nev_p90": 0.2} for cost in (0.1, 0.2)]}


def of_product():
    times = ("hot", "hot_eager_4", "hot_eager_8", "cold", "cold_prefetched", "cold_eager_4", "ray")
    return {"target": "AVX2", "rows": [{"reflectance": count, "light": 8} | dict.fromkeys(times, 10) for count in (1, 2)]}


def of_training():
    nev = {"median": 0.5, "mean": 0.6}
    return [{"train": source, "passes": passes, "log_likelihood": 1, "nev": nev, "nev_defensive": nev, "served_fraction": 1, "records": 5,
             "processor_seconds": 1 + passes} for source in SOURCES for passes in (0, 1, 2)]


def of_vertices():
    nev = {"median": 1, "p90": 2, "p99": 3}
    densities = ("bsdf", "guided", "product", "product_fixed_fractions", "product_fraction_by_kl", "product_fraction_by_nev")
    return {"nev": dict.fromkeys(densities, nev), "product_above_guided_fraction": 0.1,
            "reduction": [{"threshold": 0.2, "lobe_components": 3, "record_components": 4, "nev": nev}]}


def make(folder):
    """A copy of the scripts, with benchmarks that only print."""
    shutil.copytree(ROOT / "scripts", folder / "scripts")
    (folder / "measured").mkdir()
    tools = folder / "build/release/bin"
    tools.mkdir(parents=True)
    for name, result in (("lobebench-caches", of_fits()), ("lobebench-mixtures", of_mixtures()), ("lobebench-product", of_product()),
                         ("lobebench-illumination", of_training()), ("lobebench-vertices", of_vertices()), ("lobefit", None)):
        (tools / name).write_text(BENCHMARK.format(calls=folder / "calls"))
        (tools / name).chmod(0o755)
        (tools / f"{name}.json").write_text(json.dumps(result))


def run(folder, script, *arguments, code=0, **environment):
    done = subprocess.run([str(part) for part in (folder / "scripts" / script, *arguments)], capture_output=True, text=True,
                          env=os.environ | {"LOBE_DATA": str(folder), "FAILURE": ""} | environment)
    assert done.returncode == code and "Traceback" not in done.stderr, f"{script} exits with {done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout if code == 0 else done.stderr


def calls(folder):
    """How many there were since the last time."""
    file = folder / "calls"
    count = len(file.read_text().splitlines()) if file.exists() else 0
    file.unlink(missing_ok=True)
    return count


def check_charts(folder):
    """All have a title and a description, which scripts/report shows, and the same results give the same file."""
    for script, names in CHARTS.items():
        drawn = []
        for _ in range(2):
            run(folder, script)
            drawn.append([(folder / f"docs/charts/{name}.svg").read_text() for name in names])
        assert drawn[0] == drawn[1], f"{script}: the same results give other charts"
        assert all(word in text for text in drawn[0] for word in ("<title>", "<dc:description>")), f"{script}: no title or description"


def check_failures(folder):
    for script in CHARTS:
        assert "there is too little memory" in run(folder, script, code=1, FAILURE="there is too little memory"), script
    tool = folder / "build/release/bin/lobebench-mixtures"
    tool.rename(folder / "away")
    assert "lobebench-mixtures: no such tool" in run(folder, "bench-mixtures", code=1)
    (folder / "away").rename(tool)


def check_kept(folder):
    """Only results of the same commands and the same benchmark are used again, and scenes of the same file name are told apart."""
    for script, benchmark, count in (("bench-training", "lobebench-illumination", 1), ("bench-vertices", "lobebench-vertices", 2)):
        scenes = [folder / name / "scene.xml" for name in ("a", "b")]
        options = ["--keep", *scenes]
        calls(folder)
        shown = run(folder, script, *options)
        assert "| a |" in shown and "| b |" in shown, shown
        assert calls(folder) == 2 * count
        assert run(folder, script, *options) == shown and calls(folder) == 0
        run(folder, script, *options, "--", "--seed", "2")
        assert calls(folder) == 2 * count, "results of another command are used"
        run(folder, script, "--keep", folder / "other/a/scene.xml")
        assert calls(folder) == count, "results of another scene are used"
        tool = folder / "build/release/bin" / benchmark
        tool.write_text(f"{tool.read_text()}# new\n")
        run(folder, script, "--keep", folder / "other/a/scene.xml")
        assert calls(folder) == count, "results of another benchmark are used"


def check_ticks(folder):
    """They stand below the centre of their bars."""
    sys.path.insert(0, str(ROOT / "scripts"))
    script = runpy.run_path(str(ROOT / "scripts/bench-vertices"))
    figures = []
    script["charts"].save = lambda figure, *_: figures.append(figure)
    script["draw_densities"]([("room", of_vertices())])
    axes = figures[0].axes[0]
    bars = sorted(bar.get_x() + bar.get_width() / 2 for bar in axes.patches)
    assert len(bars) == 18
    for k, tick in enumerate(axes.get_xticks()):
        assert abs(sum(bars[6 * k:6 * k + 6]) / 6 - tick) < 1e-9, (tick, bars)


def save(path, *rows):
    """A file of scripts/report --save."""
    path.write_text(json.dumps({"plan": {}, "summary": [
        {"scene": scene, "method": method, "budget": "seconds 8", "trimmed": variance, "trimmed_spread": 0.01} for scene, method, variance in rows]}))
    return path


def check_errors(folder):
    room = save(folder / "room.json", ("room", "path", 0.2), ("room", "_hidden", 0.1), ("black", "path", 0), ("black", "_hidden", 0))
    out = folder / "hall"
    out.mkdir()
    save(folder / "hall.json", ("hall", "path", 0.2), ("hall", "guided", 0.1))
    (out / "summary.json").write_text(json.dumps(json.loads((folder / "hall.json").read_text())["summary"]))
    chart = folder / "errors.svg"
    drawn = []
    for _ in range(2):
        run(folder, "draw-errors", room, out, "-o", chart)
        drawn.append(chart.read_text())
    assert drawn[0] == drawn[1], "the same results give another chart"
    # Texts are drawn as curves, with the words as comments.
    for word in ("<!-- room -->", "<!-- hall -->", "<!-- _hidden -->", "<!-- guided -->", "<title>", "<dc:description>"):
        assert word in drawn[0], word
    assert "<!-- black -->" not in drawn[0]
    assert f"hall.json: hall is also in {out}" in run(folder, "draw-errors", out, folder / "hall.json", "-o", chart, code=1)
    alone = save(folder / "alone.json", ("hall", "path", 0.2))
    assert "there are no results besides those of path" in run(folder, "draw-errors", alone, "-o", chart, code=1)
    assert "no scene is left" in run(folder, "draw-errors", save(folder / "black.json", ("black", "path", 0)), "-o", chart, code=1)
    assert "is not a file of scripts/report --save" in run(folder, "draw-errors", chart, "-o", chart, code=1)
    assert "must end in .svg" in run(folder, "draw-errors", room, "-o", folder / "errors.png", code=2)
    assert chart.read_text() == drawn[0]


def main():
    if not importlib.util.find_spec("matplotlib"):
        print("skipped: Matplotlib is not installed (python3-matplotlib)")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="lobe-charts-") as name:
        folder = pathlib.Path(name)
        make(folder)
        for check in (check_charts, check_failures, check_kept, check_ticks, check_errors):
            check(folder)
            print(check.__name__, "passed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
