#!/usr/bin/python3
"""Evaluates and makes references with tools that only pretend to render: plan.json and references.json have all that is needed to repeat
the runs, they are continued by the same command only, wrong options are found first, and the tables and drawings of the results are complete.

Exits with 77 if Matplotlib is not installed.
"""

import csv
import hashlib
import itertools
import json
import os
import pathlib
import pty
import runpy
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED = 77
SCENE = "own-livingroom"
LONG = "method-whose-name-is-wider-than-its-crop-and-has-a-wordwithouthyphens"

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "scripts"))
import pretended_tools  # noqa: E402
import results  # noqa: E402

try:
    import numpy
    from matplotlib import image
except ImportError:
    print("skipped: Matplotlib is not installed (python3-matplotlib)")
    sys.exit(SKIPPED)


def run(script, *arguments, code=0, cwd=None, **environment):
    done = subprocess.run([str(part) for part in (ROOT / "scripts" / script, *arguments)], capture_output=True, text=True, cwd=cwd,
                          env=os.environ | {"CACHE": "first", "SCENE_HASH": "0a"} | environment)
    assert done.returncode == code, f"{script} exits with {done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout if code == 0 else done.stderr


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def edit(path, **changes):
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


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
    rows = rows_of(out / "runs.csv")
    assert {row["scene_hash"] for row in rows} == {"0a"}, rows
    assert {row["cores"] for row in rows} == {str(plan["machine"]["cores"])} and {row["cpu"] for row in rows} == {plan["machine"]["cpu"]}, rows
    assert all(float(row["processor_seconds"]) > 0 for row in rows), rows
    order = [(row["seed"], row["method"]) for row in sorted(rows, key=lambda row: row["started"])]
    path, naive, other = "a:path", "a:product-naive", f"a:{LONG}"
    assert order == [("1", path), ("1", naive), ("1", other), ("2", naive), ("2", other), ("2", path)], order


def check_refused(folder):
    """Nothing is overwritten by a command that cannot continue the evaluation."""
    out = folder / "out"
    before = contents(out)

    def refused(text, *more, **environment):
        errors = run("evaluate", *command(folder, *more), code=1, **environment)
        assert text in errors and "Traceback" not in errors, errors
        after = contents(out)
        assert all(after[path] == content for path, content in before.items()), "something is overwritten"

    refused("with other caches", CACHE="second")
    refused("the lobe cannot be fitted", CACHE="broken")
    refused("with the options --size 320x200 --seconds 8 --seed 1 --integrator path, not --size 320x200 --seconds 8 --seed 1 --threads 1 ",
            "--threads", "1")
    refused("files of the scene have changed", "--seeds", "1", "2", "3", SCENE_HASH="0b")
    refused("files of the scene have changed", "--method", "other=--integrator path", SCENE_HASH="0b")
    of_path = out / "runs" / SCENE / "a_path-s8-1"
    record, statistics = pathlib.Path(f"{of_path}.run"), pathlib.Path(f"{of_path}.json")
    for file, text, changes in ((record, "on 1000 cores, not ", {"cores": 1000}), (record, "on another machine, none, not ", {"cpu": "none"}),
                                (record, "by another loberender", {"loberender": "0"}), (record, "of another scene file", {"scene": "0"}),
                                (record, "with --jobs 2, not 1", {"jobs": 2}),
                                (statistics, "files of the scene have changed", {"scene_hash": "0b"})):
        edit(file, **changes)
        of_other, before[file] = before[file], file.read_bytes()
        refused(text, "--seeds", "1", "2", "4")
        assert not list(out.rglob("*-4.exr")), "something is rendered before"
        before[file] = of_other
        file.write_bytes(of_other)


def check_continued(folder):
    """Complete runs are not repeated, whatever the path of the folder."""
    out = folder / "out"
    times = {path.name: path.stat().st_mtime_ns for path in out.rglob("*.exr")}
    moved = folder / "moved" / "out"
    moved.parent.mkdir()
    out.rename(moved)
    missing = next(path for path in moved.rglob("*.exr") if path.stem.endswith("path-s8-2"))
    missing.unlink()
    record = next(moved.rglob("*path-s8-1.run"))
    known = json.loads(record.read_text())
    record.write_text(json.dumps({key: known[key] for key in ("command", "loberender", "scene", "caches")}))  # as those of older versions
    run("evaluate", os.path.relpath(moved), *command(folder)[1:])
    moved.rename(out)
    run("evaluate", *command(folder))
    repeated = {path.name for path in out.rglob("*.exr") if times.get(path.name) != path.stat().st_mtime_ns}
    assert repeated == {missing.name}, repeated


def interrupt(number, arguments, picture, meanwhile=lambda: None):
    """Sends the signal as soon as the picture is written, and the other function has returned."""
    environment = os.environ | {"CACHE": "first", "SCENE_HASH": "0a", "RENDER_SECONDS": "60"}
    process = subprocess.Popen([str(part) for part in arguments], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not picture.exists():
        assert process.poll() is None, f"the run is not begun: {process.stderr.read()}"
        time.sleep(0.02)
    time.sleep(0.1)  # until its statistics are written
    meanwhile()
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)  # not those of the tools
    assert process.returncode == 128 + number, (process.returncode, errors)
    assert errors.splitlines()[-1] == "interrupted; run the same command again to continue" and "Traceback" not in errors, errors


def check_interrupted(folder):
    out = folder / "interrupted"
    for number, jobs in ((signal.SIGTERM, 2), (signal.SIGINT, 2)):
        picture = out / "runs" / SCENE / "a_path-s8-1.exr"
        picture.unlink(missing_ok=True)
        interrupt(number, [ROOT / "scripts/evaluate", out, *command(folder)[1:], "--jobs", jobs], picture)


def check_locked(folder):
    """Two commands do not work in the same folder at the same time."""
    out = folder / "locked"
    arguments = [out, *command(folder)[1:]]

    def refused():
        before = contents(out)
        assert run("evaluate", *arguments, code=1) == f"{out}: another command is working in this folder\n"
        assert contents(out) == before

    interrupt(signal.SIGTERM, [ROOT / "scripts/evaluate", *arguments], out / "runs" / SCENE / "a_path-s8-1.exr", refused)
    run("evaluate", *arguments)


def check_replaced(folder):
    """Nothing is recorded for tools that have replaced those of the start."""
    tools = folder / "replaced"
    pretended_tools.make(tools)
    for tool in ("lobefit", "loberender", "lobecompare"):
        out = folder / f"of-replaced-{tool}"
        errors = run("evaluate", out, *command(folder)[1:-1], f"a={tools}", code=1, REPLACED=tool)
        assert errors.splitlines()[-1].startswith(f"{tools / tool} was replaced during the evaluation") and "Traceback" not in errors, errors
        assert bool(list(out.rglob("*.run"))) == (tool == "lobecompare") and not (out / "errors.csv").exists(), "something is recorded"


def check_repeated(folder):
    """A run that is repeated is not complete before its end, although it was."""
    picture = folder / "out/runs" / SCENE / "a_path-s8-2.exr"
    picture.unlink()
    interrupt(signal.SIGTERM, [ROOT / "scripts/evaluate", *command(folder)], picture)
    before = picture.stat().st_mtime_ns
    run("evaluate", *command(folder))
    assert picture.stat().st_mtime_ns != before, "an interrupted run is taken for a complete one"


def check_progress(folder):
    controller, terminal = pty.openpty()
    arguments = [str(part) for part in (ROOT / "scripts/evaluate", *command(folder))]
    subprocess.run(arguments, env=os.environ | {"CACHE": "first", "SCENE_HASH": "0a"}, check=True, stdout=subprocess.DEVNULL, stderr=terminal)
    shown = os.read(controller, 1 << 16).decode()
    assert f"compiling the BRDF caches of {SCENE}, 2 of 2" in shown and f"comparing the pictures of {SCENE}" in shown, shown
    assert shown.endswith("\r\033[K"), "the line of the progress is not ended"
    evaluate = runpy.run_path(str(ROOT / "scripts/evaluate"))
    slow, fast, timed = (evaluate["Run"](SCENE, method, budget, 1) for method, budget in (
        ("product", ("--spp", "4")), ("path", ("--spp", "8")), ("path", ("--seconds", "60"))))
    left = evaluate["TimeLeft"]()
    assert left.text([slow], 1) == "" and left.text([timed], 1) == ", 1 min left", "the time of samples is not known before"
    left.add(slow, 240)
    assert left.text([slow, timed], 1) == ", 5 min left" and left.text([fast, fast], 2) == ", 8 min left", "not like the other method"
    left.add(fast, 60)
    assert left.text([fast], 1) == ", 1 min left" and left.text([slow], 1) == ", 4 min left", "not like the same method"


def check_pairs(folder):
    """All pairs of seeds count."""
    arguments = [folder / "pairs", *command(folder)[1:], "--seeds", "1", "2", "3"]
    # The jackknife's means without one seed are the single pairs: 0.02, 0.03 and 0.04.
    for growth, value, spread in (("0.5", 0.03, (2 / 3 * 2 * 0.01 ** 2) ** 0.5), ("0.01", 0.0202, (2 / 3 * 2 * 0.0002 ** 2) ** 0.5)):
        run("evaluate", *arguments, RANGE=growth)
        assert [row["seeds"] for row in rows_of(folder / "pairs/errors.csv")][:3] == ["1 2", "1 3", "2 3"]
        of_path = next(one for one in results.read_summary(folder / "pairs") if one["method"] == "a:path")
        assert of_path["pairs"] == 3, of_path
        assert abs(of_path["trimmed"] - value) < 1e-9 and abs(of_path["trimmed_spread"] - spread) < 1e-9, of_path
    uncertainty = runpy.run_path(str(ROOT / "scripts/evaluate"))["uncertainty"]
    tiny = {"trimmed": 1, "trimmed_low": None, "trimmed_high": None, "seeds": "1 2"}
    assert uncertainty([tiny], "trimmed") is None, "an uncertainty of 0"
    # Without seed i, the mean over the pairs is that of the sums of two of the other three seeds, (36 - i) * 2 / 3.
    pairs = [{"seeds": f"{a} {b}", "trimmed": a + b} for a, b in itertools.combinations((1, 5, 12, 18), 2)]
    means = [(36 - seed) * 2 / 3 for seed in (1, 5, 12, 18)]
    expected = (3 / 4 * sum((mean - sum(means) / 4) ** 2 for mean in means)) ** 0.5
    assert abs(uncertainty(pairs, "trimmed") - expected) < 1e-12, (uncertainty(pairs, "trimmed"), expected)


def check_plan_last(folder):
    """The plan stays that of the tables if these cannot be written."""
    out = folder / "pairs"
    plan, errors = (out / "plan.json").read_bytes(), (out / "errors.csv").read_bytes()
    (out / "errors.csv.tmp").mkdir()
    assert "errors.csv.tmp" in run("evaluate", out, *command(folder)[1:], "--seeds", "1", "2", code=1)
    assert (out / "plan.json").read_bytes() == plan and (out / "errors.csv").read_bytes() == errors
    (out / "errors.csv.tmp").rmdir()


def check_black(folder):
    """The means of methods are relative to that of all, whichever of them is black."""
    tools, out = folder / "tools", folder / "black"
    arguments = ["--scenes", SCENE, "--seconds", "8", "--methods", "--method", "black=--max-depth 1", "--method"]
    # Tools of the current folder are not looked for in PATH.
    run("evaluate", out, *arguments, "other=--integrator path", "--build", "a=.", cwd=tools)
    assert {one["method"]: one["relative_mean"] for one in results.read_summary(out)} == {"a:black": 0, "a:other": 2}


def check_missing_statistic(folder):
    """Older tools do not have all statistics."""
    out = folder / "older"
    run("evaluate", out, *command(folder)[1:], MISSING="rays")
    assert {row["rays"] for row in rows_of(out / "runs.csv")} == {""}
    assert all("rays" not in one and one["spp"] == 1 for one in results.read_summary(out))
    assert "|  |" in run("report", out, "--markdown").splitlines()[-1]


def check_command(folder):
    """The recorded command has OUT in place of the folder, but not of words that are equal to its name."""
    out = folder / "path"
    arguments = ["--scenes", SCENE, "--methods", "path", "--seconds", "8", "--build", f"a={folder / 'tools'}"]
    run("evaluate", *arguments, "path", cwd=folder)
    assert json.loads((out / "plan.json").read_text())["command"] == ["scripts/evaluate", *arguments, "OUT"]


def check_usage(folder):
    def wrong(text, *arguments, **environment):
        errors = run("evaluate", *arguments, code=2, **environment)
        assert text in errors and "Traceback" not in errors, errors

    def wrong_option(text, *more):
        wrong(text, *command(folder, *more))

    wrong_option("there is no method 'guided'", "--fit", "guided=--quality 0.1")
    wrong_option("no ':' and no '/'", "--method", "a:b=--integrator path")
    wrong_option("No closing quotation", "--method", "b=--integrator 'path")
    for option in ("--seconds", "--spp", "--seeds", "--threads", "--jobs"):
        for value in ("0", "nan", "many"):
            wrong_option(f"{option}: '{value}' is not a positive ", option, value)
    for option, values in {"--seconds": ("1", "1.0"), "--spp": ("2", "2"), "--seeds": ("1", "2", "1"), "--scenes": (SCENE, SCENE),
                           "--methods": ("path", "path")}.items():
        wrong_option("is given twice", option, *values)
    wrong_option("'path' is given twice", "--method", "path=--integrator bdpt")
    wrong_option("--build: 'a' is given twice", "--build", "a=elsewhere")
    wrong_option("the name of a build has no '+', not 'a+path'", "--build", f"a+path={folder / 'tools'}")
    wrong_option("a:b_path and a_b:path would write the same files", "--method", "b_path=--integrator path", "--build", f"a_b={folder / 'tools'}")
    wrong_option("is not SCENE=WIDTHxHEIGHT", "--size", "nowhere=10x10")
    wrong_option("is not SCENE=WIDTHxHEIGHT", "--size", f"{SCENE}=10")
    wrong_option("nowhere/loberender: no such tool", "--build", "b=nowhere")
    new = folder / "new"
    wrong("there is nothing to evaluate", new, "--scenes", SCENE, "--methods", "--build", f"a={folder / 'tools'}")
    wrong("kitchen/scene.xml: no such scene file", new, "--scenes", "kitchen", LOBE_DATA=str(folder))
    assert not new.exists()
    wrong("tools/lobefit is not a folder", folder / "tools/lobefit", *command(folder)[1:])
    within = folder / "tools/lobefit/within"
    assert run("evaluate", within, *command(folder)[1:], code=1) == f"{within}: Not a directory; choose a folder that can be written\n"


def write_exr(path, width, height):
    """Only as much of a picture as scripts/evaluate reads itself."""
    path.write_bytes(b"\x76\x2f\x31\x01\2\0\0\0displayWindow\0box2i\0" + struct.pack("<i4i", 16, 0, 0, width - 1, height - 1))


def check_import(folder):
    peer, times = folder / "peer", folder / "peer/times.csv"
    peer.mkdir()

    def wrong(text, *more):
        errors = run("evaluate", *command(folder, "--import", "peer", peer, "--seeds", "1", "2", "5", *more), code=2)
        assert text in errors and "Traceback" not in errors, errors
        assert not list((folder / "out").rglob("*-5.exr")), "something is rendered"

    wrong("has no pictures SCENE-SEED.exr")
    pictures = [peer / f"{SCENE}-{seed}.exr" for seed in (1, 2)]
    pictures[0].mkdir()
    wrong("Is a directory")
    pictures[0].rmdir()
    write_exr(pictures[0], 320, 200)
    one = subprocess.run([str(part) for part in (ROOT / "scripts/evaluate", folder / "one", *command(folder, "--import", "peer", peer)[1:])],
                         capture_output=True, text=True, env=os.environ | {"CACHE": "first", "SCENE_HASH": "0a"})
    assert one.returncode == 0 and f"warning: --import peer: there is one picture of {SCENE}" in one.stderr, one.stderr
    pictures[1].write_text("picture")
    wrong("is not an EXR file")
    write_exr(pictures[1], 320, 201)
    wrong("has 320x201 pixels, and the evaluation 320x200")
    write_exr(pictures[1], 320, 200)
    wrong("'peer' is given twice", "--import", "peer", peer)
    wrong("is the name of a method", "--import", "a:path", peer)
    for text in ("scene,seconds\n,1\n", f"scene,seed,seconds\n{SCENE},1,long\n", f"scene,seed,seconds\n{SCENE},1\n"):
        times.write_text(text)
        wrong("times.csv must have the columns scene, seed and seconds")
    times.write_text(f"scene,seed,seconds\n{SCENE},1,-1\n")
    wrong("seconds must be positive")
    times.write_text(f"scene,seed,seconds\n{SCENE},1,3\n{SCENE},2,5\n")
    shown = run("evaluate", *command(folder, "--import", "peer", peer))
    assert shown.splitlines()[2] == (f"| {SCENE}, 8 s | 0.02 ± 0.002 (0.02) | **0.01 ± 0.001 (0.01)** | **0.0118 ± 0.001 (0.0118)** "
                                     "| 0.01 ± 0.001 (0.01) |"), shown
    plan = json.loads((folder / "out/plan.json").read_text())
    assert plan["imports"]["peer"][f"{SCENE}-2.exr"] == sha256(peer / f"{SCENE}-2.exr"), plan
    of_peer = results.read_summary(folder / "out")[-1]
    assert of_peer["method"] == "peer" and of_peer["seconds_total"] == 4, of_peer
    assert abs(of_peer["relative_mean"] - 0.7 / 0.925) < 1e-9, of_peer
    means = {row["method"]: float(row["relative_mean"]) for row in rows_of(folder / "out/errors.csv")}
    assert abs(means["peer"] - 0.7 / 0.925) < 1e-9 and abs(means["a:path"] - 1 / 0.925) < 1e-9, means


def check_import_only(folder):
    out = folder / "peers"
    shown = run("evaluate", out, "--scenes", SCENE, "--methods", "--build", f"a={folder / 'tools'}", "--import", "peer", folder / "peer")
    assert shown.splitlines() == ["|  | peer |", "|---|---|", f"| {SCENE}, imported | 0.01 ± 0.001 (0.01) |"], shown
    best = run("report", out, "--markdown").split("\n\n")[1].splitlines()
    assert best[2] == f"| {SCENE}, imported | 0.01 ± 0.001 |", best
    run("report", out, "--tools", folder / "tools")


def check_markdown(folder):
    machine = json.loads((folder / "out/plan.json").read_text())["machine"]
    parts = run("report", folder / "out", "--markdown").split("\n\n")
    assert parts[0].startswith(f"{machine['cpu']}, {machine['cores']} core"), parts[0]
    assert parts[1].splitlines() == [f"|  | a:path | a:product-naive | a:{LONG} | peer |", "|---|---|---|---|---|",
                                     f"| {SCENE}, 8 s | 0.02 ± 0.002 | **0.01 ± 0.001** | **0.0118 ± 0.001** | 0.01 ± 0.001 |"], parts[1]
    assert parts[2] == (f"Lowest, of 1 scene: `a:product-naive` alone in 0, among the lowest in 1; `a:{LONG}` alone in 0, among the lowest "
                        "in 1."), parts[2]
    assert parts[4].splitlines()[-1].endswith(" | 0.757 |"), parts[4]


def check_report_usage(folder):
    out = folder / "out"

    def wrong(text, *arguments, code=2):
        errors = run("report", *arguments, code=code)
        assert text in errors and "Traceback" not in errors, errors
        assert not (out / "report.html").exists() and not (folder / "no").exists()

    wrong("nowhere/lobecompare: no such tool; build it, or name its folder by --tools FOLDER", out, "--tools", folder / "nowhere")
    for option in ("-o", "--save"):
        wrong("no/file: its folder does not exist", out, option, folder / "no/file")
        wrong("tools is a folder", out, option, folder / "tools")
    wrong("plan.json is not a folder of scripts/evaluate", out / "plan.json", code=1)
    wrong("no/summary.json: not found; run scripts/evaluate", folder / "no", code=1)
    for others in (("--markdown", "-o", "page.html"), ("--save", "saved.json", "--markdown"), ("--save", "saved.json", "-o", "page.html")):
        wrong("not allowed with argument", out, *others)
    plan = out / "plan.json"
    plan.rename(folder / "away.json")
    wrong("plan.json: not found; run scripts/evaluate", out, code=1)
    (folder / "away.json").rename(plan)


def check_page(folder):
    """Names of methods cannot end the script of the page, change how a browser reads it, or split cells of the tables in Markdown."""
    out = folder / "page"
    run("evaluate", out, "--scenes", SCENE, "--methods", "--method", "<!--<script>|=--integrator path", "--build", f"a={folder / 'tools'}")
    run("report", out, "--tools", folder / "tools")
    page = (out / "report.html").read_text()
    data = page.partition("const data = ")[2].partition("\n")[0]
    assert run("report", out, "--markdown").count("| a:<!--<script>\\| |") == 3, "names of methods split cells"
    assert "<" not in data and json.loads(data.rstrip(";"))["summary"][0]["method"] == "a:<!--<script>|", data
    assert not list(out.glob("*.tmp"))


def check_update(folder):
    """Tables of a Markdown file are made again from saved evaluations, and what stands around them stays."""
    text = folder / "text.md"
    run("report", folder / "out", "--save", folder / "saved.json")
    text.write_text("Before.\n\n<!-- evaluation: saved.json -->\nold\n<!-- end of evaluation -->\n\nAfter.\n")
    run("report", "--update", text)
    updated = text.read_text()
    assert updated.startswith("Before.\n\n<!-- evaluation: saved.json -->\n\n|  | a:path |"), updated
    assert updated.endswith("\n\n<!-- end of evaluation -->\n\nAfter.\n") and "old" not in updated, updated
    assert "\n\n" + run("report", folder / "out", "--markdown").splitlines()[0] + "\n" in updated, updated
    assert f"\n    scripts/evaluate OUT --scenes {SCENE} " in updated, updated
    assert "" == run("report", "--update", text) and text.read_text() == updated, text.read_text()
    for wrong in ("", "<!-- evaluation: saved.json -->\n<!-- end of evaluations -->\n" + updated, updated.replace("evaluation:", "evaluate:")):
        text.write_text(wrong)
        assert "text.md: must have lines" in run("report", "--update", text, code=1) and text.read_text() == wrong, wrong
    saved = json.loads((folder / "saved.json").read_text())
    for name in ("second", "third"):
        plan = saved["plan"] | ({"jobs": 2} if name == "third" else {})
        (folder / f"{name}.json").write_text(json.dumps({"plan": plan, "summary": [one | {"scene": name} for one in saved["summary"]]}))
    text.write_text("<!-- evaluation: saved.json second.json third.json -->\n<!-- end of evaluation -->\n")
    run("report", "--update", text)
    machine = f"{saved['plan']['machine']['cpu']}, {saved['plan']['machine']['cores']} core"
    lines = [line.partition(machine)[0] for line in text.read_text().splitlines() if machine in line]
    assert lines == [f"{SCENE}, second: ", "third: "], lines
    text.write_text("<!-- evaluation: saved.json saved.json -->\n<!-- end of evaluation -->\n")
    assert f"saved.json: {SCENE}, " in run("report", "--update", text, code=1)
    text.write_text("<!-- evaluation: missing.json -->\n<!-- end of evaluation -->\n")
    assert "missing.json: not found" in run("report", "--update", text, code=1)
    assert "give either OUT or --update FILE.md" in run("report", code=2)


def check_results(folder):
    """The tables of docs/results.md are those of docs/data."""
    shutil.copytree(ROOT / "docs/data", folder / "data")
    copied = pathlib.Path(shutil.copy(ROOT / "docs/results.md", folder))
    run("report", "--update", copied)
    assert copied.read_text() == (ROOT / "docs/results.md").read_text(), "run scripts/report --update docs/results.md"


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
    # The pictures have 64×40 pixels, the crops 13×8, enlarged 11 times.
    crops = 90 + 8 + 88
    assert drawn.shape[0] > crops + 30, drawn.shape
    captions = drawn[crops:]
    assert captions[:, 160:].min() < 0.5, "there are no captions"
    first = drawn[98:186, :160]
    inside = first[:, 80 - 72:80 - 72 + 143]
    assert inside.max() < 0.6 and numpy.delete(first, range(8, 151), axis=1).min() == 1, "crops are not enlarged by a whole number"
    assert min(edge.min() for edge in (captions[:, :3], captions[:, -3:], captions[-3:])) == 1, "captions are cut off"


def check_comparison_usage(folder):
    picture, out = folder / "picture.png", folder / "none.png"

    def draw(*arguments, code):
        return run("draw-comparison", folder / "out", SCENE, *arguments, "--methods", "a:path", "-o", out, code=code)

    for crop in ((".9", ".9", ".5", ".5"), ("-0.1", "0", "1", "1"), ("0", "0", "0", "1")):
        assert "--crop is not inside the picture" in draw(picture, "--crop", *crop, code=2), crop
    missing = draw(folder / "missing.png", "--crop", "0", "0", "1", "1", code=1)
    assert missing.endswith("missing.png: not found\n") and missing.count("\n") == 1, missing
    first = folder / f"out/runs/{SCENE}/a_path-s8-1.png"
    first.rename(folder / "away.png")
    assert "a_path-s8-1.png: not found" in draw(picture, "--crop", "0", "0", "1", "1", code=1)
    (folder / "away.png").rename(first)
    assert not out.exists()
    # The crop may be the whole picture. Captions have two digits.
    run("draw-comparison", folder / "out", SCENE, picture, "--crop", "0", "0", "1", "1", "--methods", "a:path", f"a:{LONG}", "-o", out)
    sys.path.insert(0, str(ROOT / "scripts"))
    script = runpy.run_path(str(ROOT / "scripts/draw-comparison"))
    assert [script["caption"]("path", {"trimmed": value, "budget": "seconds 8"})[1] for value in (0.0603, 0.061, 1.0, 12)] == \
        ["variance 0.060", "variance 0.061", "variance 1.0", "variance 12"]
    assert script["cut"](numpy.arange(40).reshape(4, 10), (0.999, 0.999, 0.001, 0.001)).tolist() == [[39]], "not the last pixel"
    assert script["enlarged"](numpy.arange(40).reshape(4, 10), 5).tolist() == [[11, 13, 15, 17, 19], [31, 33, 35, 37, 39]]


def check_charts(folder):
    run("draw-errors", folder / "out", "--baseline", "a:path", "-o", folder / "errors.svg")
    assert "product-naive" in (folder / "errors.svg").read_text()
    for option in ("--baseline", "--methods"):
        errors = run("draw-errors", folder / "out", "--baseline", "a:path", option, "guided", "-o", folder / "none.svg", code=2)
        assert f"{option}: there are no results of 'guided'; known: a:path, a:product-naive" in errors, errors
    room = folder / "room"
    room.mkdir()
    rows = [f"{10 + n},{n},{0.4 / n},{0.3 / n ** 0.9},1000" for n in range(1, 65)]
    (room / "product.csv").write_text("\n".join(["seconds,spp,error,trimmed,resident_bytes", *rows]))
    run("draw-long-run", room, "-o", folder / "long.svg")
    assert "product, 74 s: -1.00 (-0.90)" in (folder / "long.svg").read_text(), "the slope is not shown"
    assert "has no tables" in run("draw-long-run", folder, "-o", folder / "none.svg", code=1)


def errors_of_long_run(folder, *more, **environment):
    """The output, and the errors of the snapshots as text."""
    out = folder / "long"
    shown = run("bench-long-run", out, ROOT / "scenes/livingroom.xml", "2", "--method", "bdpt-gradients", "--tools", folder / "tools", *more,
                **environment)
    with open(out / "bdpt-gradients.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) >= 2 and rows[-1]["spp"] == "3.0", rows
    return shown, [row["error"] for row in rows]


def check_long_run(folder):
    shown, errors = errors_of_long_run(folder)
    assert "bdpt-gradients: slope over the samples 0.000, of the trimmed variance 0.000" in shown and "no error" not in shown, shown
    assert (folder / "long/bdpt-gradients-1.exr").read_text().count("--integrator bdpt --gradients l2"), "not the options of the method"
    # Half of the relMSE of both last pictures.
    assert set(map(float, errors)) == {0.01}, errors
    run("draw-long-run", folder / "long", "-o", folder / "long.svg")
    assert ": 0.00 (0.00)" in (folder / "long.svg").read_text()


def check_missing_errors(folder):
    """The difference of the first snapshots from the other run is less than the error of its last picture."""
    shown, errors = errors_of_long_run(folder, FIRST_RELMSE="0.005")
    assert errors[0] == "nan" and set(map(float, errors[1:])) == {0.01}, errors
    assert f"1 of {len(errors)} snapshots have no error" in shown and "samples 0.000" in shown, shown
    run("draw-long-run", folder / "long", "-o", folder / "long.svg")
    assert ": 0.00 (0.00)" in (folder / "long.svg").read_text()
    # Without two different numbers of samples, there is no slope.
    (folder / "long/bdpt-gradients.csv").write_text("seconds,spp,error,trimmed,resident_bytes\n1,1,nan,0.1,\n2,2,0.2,0.1,\n")
    run("draw-long-run", folder / "long", "-o", folder / "long.svg")
    assert ": nan (0.00)" in (folder / "long.svg").read_text()


SLEEPING = f"""#!{sys.executable}
import sys
import time
if sys.argv[sys.argv.index("--seed") + 1] == FAILING:
    sys.exit(3)
print("begun", file=sys.stderr, flush=True)
time.sleep(60)
"""


def check_ended_long_run(folder):
    """If one of the runs fails, or the script is interrupted, both are ended."""
    tools, out = folder / "sleeping", folder / "ended"
    pretended_tools.make(tools)
    command = [str(part) for part in (ROOT / "scripts/bench-long-run", out, ROOT / "scenes/livingroom.xml", "60", "--tools", tools)]

    def start(failing):
        (tools / "loberender").write_text(SLEEPING.replace("FAILING", repr(failing)))
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def ended(process, code, text):
        shown, errors = process.communicate(timeout=20)
        assert process.returncode == code and text in errors and "Traceback" not in errors and not shown, (process.returncode, errors)
        commands = [path.read_bytes() for path in pathlib.Path("/proc").glob("[0-9]*/cmdline") if os.access(path, os.R_OK)]
        assert not any(str(tools / "loberender").encode() in words for words in commands), "loberender goes on"

    ended(start("1"), 1, "loberender failed with code 3")
    seeds = (1, 2) if len(os.sched_getaffinity(0)) > 1 else (1,)
    for number in (signal.SIGTERM, signal.SIGINT):
        for log in out.glob("*.log"):
            log.unlink()
        process = start(None)
        while not all((log := out / f"product-{seed}.log").exists() and log.read_text() for seed in seeds):
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)
        process.send_signal(number)
        ended(process, 128 + number, "interrupted")
    assert not list(out.glob("*.csv*"))
    (tools / "lobecompare").unlink()
    ended(start(None), 2, "no such tool")


def check_memory(_):
    """That of the run that uses more."""
    script = runpy.run_path(str(ROOT / "scripts/bench-long-run"))
    script["pair"].__globals__["compare"] = lambda *_: {"relvar_drop_1pct": 0.1}
    a, b, c = ({"picture": "", "seconds": 1, "spp": 1, "error": 0.1, "resident_bytes": memory} for memory in (5, 7, None))
    assert [script["pair"](None, *rows)["resident_bytes"] for rows in ((a, b), (b, a), (c, a), (c, c))] == [7, 7, 5, None]


def check_reference(folder):
    references = folder / "references"
    references.mkdir()
    reference = references / "livingroom.exr"

    def wrong(text, *more):
        errors = run("bench-long-run", folder / "wrong", SCENE, "2", "--reference", reference, "--tools", folder / "tools", *more, code=2)
        assert text in errors and "Traceback" not in errors, errors
        assert not (folder / "wrong").exists(), "something is rendered"

    wrong("No such file")
    reference.write_text("picture")
    wrong("is not an EXR file")
    write_exr(reference, 64, 40)
    wrong("has 64x40 pixels, not 32x20", "--size", "32x20")
    (references / "references.json").write_text("[{")
    wrong("references.json")
    (references / "references.json").unlink()
    _, errors = errors_of_long_run(folder, "--reference", reference)
    assert set(map(float, errors)) == {0.02}, errors
    assert "--size 64x40" in (folder / "long/bdpt-gradients-1.exr").read_text(), "not the size of the reference"
    (references / "references.json").write_text(json.dumps([{"scene": "livingroom", "reference": "bdpt", "methods": {"bdpt": {"relvar": 0.005}}}]))
    _, errors = errors_of_long_run(folder, "--reference", reference)
    assert all(abs(float(error) - 0.015) < 1e-9 for error in errors), errors


def check_made_references(folder):
    """The picture of a biased method is no reference, however low its variance, and the reference is not taken for that of other files."""
    tools, scene, out = folder / "tools", folder / "room.xml", folder / "made"
    scene.write_bytes((ROOT / "scenes/livingroom.xml").read_bytes())
    command = [out, scene, "--spp", "1", "--runs", "4", "--methods", "path", "vcm", "--tools", tools]
    assert "the reference is that of path" in run("make-references", *command)
    table = (out / "references.json").read_text()
    one = json.loads(table)[0]
    assert one["hashes"] == {tool: sha256(tools / tool) for tool in ("loberender", "lobefit", "lobecompare")} | \
        {"scene": sha256(scene), "caches": {"a.lobe": sha256(out / "room/caches/a.lobe")}}, one
    assert one["version"] == "loberender 0.0.0" and one["threads"] is None and one["methods"]["vcm"]["scene_hash"] == "0a", one
    assert one["machine"]["cores"] == len(os.sched_getaffinity(0)) and one["methods"]["vcm"]["options"] == ["--integrator", "vcm"], one
    for file in (scene, tools / "loberender"):
        content = file.read_bytes()
        file.write_bytes(content + b"\n")
        assert "by other tools, of another scene" in run("make-references", *command, code=1, CACHE="second"), file
        assert (out / "room/caches/a.lobe").read_text() == "first", "lobefit is run before"
        file.write_bytes(content)
    assert "with other caches" in run("make-references", *command, code=1, CACHE="second")
    errors = run("make-references", *command, "--runs", "5", code=1, SCENE_HASH="0b")
    assert "files of the scene have changed" in errors, errors
    assert (out / "references.json").read_text() == table, "the table is not that of the reference"
    errors = run("make-references", *command, "--methods", "vcm", "cut=--integrator path --firefly-limit 1", code=2)
    assert "at least one method without a bias" in errors, errors


def check_resumed_references(folder):
    """Interrupted runs are ended, and continued from checkpoints that are known to be theirs."""
    tools, scene, out = folder / "tools", ROOT / "scenes/livingroom.xml", folder / "resumed"
    command = [out, scene, "--spp", "1", "--runs", "4", "--methods", "path", "bdpt", "--tools", tools]
    picture = out / "livingroom/path/1.exr"
    begun, checkpoint = picture.with_suffix(".begun"), picture.with_suffix(".ckpt")
    for number in (signal.SIGTERM, signal.SIGINT):
        picture.unlink(missing_ok=True)
        interrupt(number, [ROOT / "scripts/make-references", *command], picture)
        commands = [path.read_bytes() for path in pathlib.Path("/proc").glob("[0-9]*/cmdline") if os.access(path, os.R_OK)]
        assert not any(str(picture).encode() in words for words in commands), "loberender goes on"
    checkpoint.write_text("state")
    content = begun.read_text()
    edit(begun, loberender="0")
    assert "1.begun was made by another command, by other tools" in run("make-references", *command, code=1, CACHE="second")
    assert (out / "livingroom/caches/a.lobe").read_text() == "first", "lobefit is run before"
    begun.write_text(content)
    run("make-references", *command)
    assert f"--resume {checkpoint}" in picture.read_text() and not begun.exists() and not checkpoint.exists()
    # Nothing is known of this checkpoint, neither now nor later.
    picture.with_suffix(".run").unlink()
    picture.unlink()
    checkpoint.write_text("state")
    interrupt(signal.SIGTERM, [ROOT / "scripts/make-references", *command], picture)
    assert "--resume" not in picture.read_text() and not checkpoint.exists()


def main():
    with tempfile.TemporaryDirectory(prefix="lobe-evaluate-") as name:
        folder = pathlib.Path(name)
        pretended_tools.make(folder / "tools")
        for check in (check_plan, check_refused, check_continued, check_interrupted, check_locked, check_replaced, check_repeated,
                      check_progress, check_pairs, check_plan_last, check_black, check_missing_statistic, check_command, check_usage,
                      check_import, check_import_only, check_markdown, check_report_usage, check_page, check_update, check_results,
                      check_comparison, check_comparison_usage, check_charts, check_long_run, check_missing_errors, check_ended_long_run,
                      check_memory, check_reference, check_made_references, check_resumed_references):
            check(folder)
            print(check.__name__, "passed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
