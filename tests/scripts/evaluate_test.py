#!/usr/bin/python3
"""Evaluates with tools that only pretend to render: plan.json has all that is needed to repeat the runs, runs by other caches or of another
scene are refused, and the tables and drawings of the results are complete.

Exits with 77 if Matplotlib is not installed.
"""

import csv
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED = 77
SCENE = "own-livingroom"
LONG = "method-whose-name-is-wider-than-its-crop-and-has-a-wordwithouthyphens"

try:
    import numpy
    from matplotlib import image
except ImportError:
    print("skipped: Matplotlib is not installed (python3-matplotlib)")
    sys.exit(SKIPPED)

TOOL = f"""#!{sys.executable}
import sys
sys.path.insert(0, {str(pathlib.Path(__file__).resolve().parent)!r})
sys.dont_write_bytecode = True
import pretended_tools
pretended_tools.NAME(sys.argv[1:])
"""


def make_tools(folder):
    folder.mkdir()
    for name in ("loberender", "lobefit", "lobecompare"):
        (folder / name).write_text(TOOL.replace("NAME", name))
        (folder / name).chmod(0o755)


def run(script, *arguments, code=0, **environment):
    done = subprocess.run([str(part) for part in (ROOT / "scripts" / script, *arguments)], capture_output=True, text=True,
                          env=os.environ | {"CACHE": "first", "SCENE_HASH": "0a"} | environment)
    assert done.returncode == code, f"{script} exits with {done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout if code == 0 else done.stderr


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def command(folder, *more):
    return [folder / "out", "--scenes", SCENE, "--methods", "path", "product-naive", "--method", f"{LONG}=--integrator guided", "--seconds", "8",
            "--build", f"a={folder / 'tools'}", *more]


def check_plan(folder):
    out = folder / "out"
    run("evaluate", *command(folder))
    plan = json.loads((out / "plan.json").read_text())
    cpus = [line.split(":")[1].strip() for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line]
    assert plan["machine"]["cores"] == len(os.sched_getaffinity(0)), plan
    assert not cpus or plan["machine"]["cpu"] == cpus[0], plan
    assert plan["scenes"][SCENE]["sha256"] == sha256(ROOT / "scenes/livingroom.xml"), plan
    assert plan["scenes"][SCENE]["scene_hashes"] == ["0a"], plan
    assert plan["builds"]["a"]["lobefit"] == sha256(folder / "tools/lobefit"), plan
    assert "--reduction 0" in plan["fits"]["product-naive"], plan
    of_naive = f"caches/a+product-naive/{SCENE}"
    assert plan["caches"][of_naive] == {"a.lobe": sha256(out / of_naive / "a.lobe")}, plan
    assert set(plan["caches"]) == {of_naive, f"caches/a/{SCENE}"}, plan
    with open(out / "runs.csv", newline="") as file:
        assert {row["scene_hash"] for row in csv.DictReader(file)} == {"0a"}


def check_refused(folder):
    out = folder / "out"
    before = (out / "plan.json").read_text()
    made = {path: path.stat().st_mtime_ns for path in out.rglob("*.exr")}
    errors = run("evaluate", *command(folder), code=1, CACHE="second")
    assert "with other caches" in errors, errors
    assert (out / "plan.json").read_text() == before, "the plan is not that of the runs"
    errors = run("evaluate", *command(folder), "--seeds", "1", "2", "3", code=1, SCENE_HASH="0b")
    assert "files of the scene have changed" in errors, errors
    run("evaluate", *command(folder))
    assert all(path.stat().st_mtime_ns == when for path, when in made.items()), "complete runs are repeated"


def check_usage(folder):
    assert "there is no method 'guided'" in run("evaluate", *command(folder, "--fit", "guided=--quality 0.1"), code=2)
    assert "no ':' and no '/'" in run("evaluate", *command(folder, "--method", "a:b=--integrator path"), code=2)


def check_import(folder):
    peer = folder / "peer"
    peer.mkdir()
    errors = run("evaluate", *command(folder, "--import", "peer", peer), code=2)
    assert "has no pictures SCENE-SEED.exr" in errors, errors
    for seed in (1, 2):
        (peer / f"{SCENE}-{seed}.exr").write_text("picture")
    run("evaluate", *command(folder, "--import", "peer", peer))
    plan = json.loads((folder / "out/plan.json").read_text())
    assert plan["imports"]["peer"][f"{SCENE}-2.exr"] == sha256(peer / f"{SCENE}-2.exr"), plan


def check_markdown(folder):
    machine = json.loads((folder / "out/plan.json").read_text())["machine"]
    parts = run("report", folder / "out", "--markdown").split("\n\n")
    assert parts[0].startswith(f"{machine['cpu']}, {machine['cores']} cores;"), parts[0]
    assert parts[1].splitlines() == [f"|  | a:path | a:product-naive | a:{LONG} | peer |", "|---|---|---|---|---|",
                                     f"| {SCENE}, 8 s | 0.02 | **0.01** | **0.01** | 0.01 |"], parts[1]
    assert parts[2] == f"Lowest, of 1 scenes: `a:product-naive` in 1, `a:{LONG}` in 1.", parts[2]


def check_comparison(folder):
    """The picture is copied as it is, and nothing of the captions is cut off, which would leave ink at the edges of the drawing."""
    picture, drawing = folder / "picture.png", folder / "comparison.png"
    image.imsave(picture, numpy.random.default_rng(1).random((90, 160, 3)))
    run("draw-comparison", folder / "out", SCENE, picture, "--crop", "0.4", "0.4", "0.2", "0.2", "--methods", "a:path", f"a:{LONG}", "-o", drawing)
    drawn, original = image.imread(drawing)[:, :, :3], image.imread(picture)[:, :, :3]
    left = (drawn.shape[1] - 160) // 2
    difference = numpy.abs(drawn[:90, left:left + 160] - original)
    difference[30:60, 60:100] = 0  # the frame of the crop
    assert difference.max() < 0.01, "the picture is resampled"
    crops = 90 + 8 + 90
    assert drawn.shape[0] > crops + 30, drawn.shape
    captions = drawn[crops:]
    assert captions[:, 160:].min() < 0.5, "there are no captions"
    assert min(edge.min() for edge in (captions[:, :3], captions[:, -3:], captions[-3:])) == 1, "captions are cut off"


def check_charts(folder):
    run("draw-errors", folder / "out", "--baseline", "a:path", "-o", folder / "errors.svg")
    assert "product-naive" in (folder / "errors.svg").read_text()
    room = folder / "room"
    room.mkdir()
    rows = [f"{10 + n},{n},{0.4 / n},{0.3 / n ** 0.9},1000" for n in range(1, 65)]
    (room / "product.csv").write_text("\n".join(["seconds,spp,error,trimmed,resident_bytes", *rows]))
    run("draw-long-run", room, "-o", folder / "long.svg")
    assert "product, 74 s: -1.00 (-0.90)" in (folder / "long.svg").read_text(), "the slope is not shown"
    assert "has no tables" in run("draw-long-run", folder, "-o", folder / "none.svg", code=1)


def check_long_run(folder):
    out = folder / "long"
    shown = run("bench-long-run", out, ROOT / "scenes/livingroom.xml", "2", "--method", "bdpt-gradients", "--tools", folder / "tools")
    assert "bdpt-gradients: slope 0.000, of the trimmed variance 0.000" in shown, shown
    assert (out / "bdpt-gradients-1.exr").read_text().count("--integrator bdpt --gradients l2"), "not the options of the method"
    with open(out / "bdpt-gradients.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) >= 2 and rows[-1]["spp"] == "3.0", rows
    # Half of the relMSE of both last pictures.
    assert {float(row["error"]) for row in rows} == {0.01}, rows
    run("draw-long-run", out, "-o", folder / "long.svg")
    assert ": 0.00 (0.00)" in (folder / "long.svg").read_text()


def main():
    with tempfile.TemporaryDirectory(prefix="lobe-evaluate-") as name:
        folder = pathlib.Path(name)
        make_tools(folder / "tools")
        for check in (check_plan, check_refused, check_usage, check_import, check_markdown, check_comparison, check_charts, check_long_run):
            check(folder)
            print(check.__name__, "passed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
