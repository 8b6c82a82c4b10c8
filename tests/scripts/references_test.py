#!/usr/bin/python3
"""Makes references of a small scene: methods that agree give one reference with its variance, an interrupted run is resumed, and methods
that disagree are reported and both kept.

The argument is the folder of the tools.
"""

import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SCENE = ROOT / "tests/data/room.xml"
QUICK = "--passes 1 --photons 2000 --importons 1000 --russian-roulette throughput --light-paths off"


def start(tools, out, *options):
    command = [ROOT / "scripts/make-references", out, SCENE, "--tools", tools, "--runs", "4", *options]
    return subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def run(tools, out, *options, code=0):
    done = start(tools, out, *options)
    text, errors = done.communicate()
    assert done.returncode == code, f"exit code {done.returncode}\n{text}{errors}"
    return text, errors


def complete_runs(out):
    return {path: path.stat().st_mtime_ns for path in (out / "room").rglob("*.run")}


def check_agreement(tools, out):
    # A scene of an earlier command, whose methods disagreed.
    out.mkdir()
    (out / "references.json").write_text(json.dumps([{"scene": "other", "reference": None}]))
    options = ("--spp", "16", "--size", "16x16", "--methods", f"product=--integrator product {QUICK}", "path")
    text, _ = run(tools, out, *options)
    assert "room: the methods agree" in text, text
    result = json.loads((out / "references.json").read_text())[1]
    assert result["test"]["agree"] and result["reference"] in ("product", "path"), result
    assert result["methods"]["path"]["samples"] == 4 * 16, result
    for name in ("room.exr", "room-variance.exr", "room/product.exr", "room/path-variance.exr"):
        assert (out / name).exists(), name
    before = complete_runs(out)
    assert len(before) == 8, before
    run(tools, out, *options)
    assert before == complete_runs(out), "complete runs are repeated"
    _, errors = run(tools, out, "--spp", "17", *options[2:], code=1)
    assert "made by another command" in errors, errors


def check_disagreement(tools, out):
    text, _ = run(tools, out, "--spp", "16", "--size", "16x16", "--methods", "path",
                  "short=--integrator path --max-depth 2 --gradients l2", code=1)
    assert "THE METHODS DISAGREE" in text, text
    assert json.loads((out / "references.json").read_text())[0]["reference"] is None
    assert not (out / "room.exr").exists(), "a reference is made of methods that disagree"
    assert (out / "room/path.exr").exists() and (out / "room/short-variance.exr").exists()


def check_resumed(tools, out):
    options = ("--spp", "8000", "--size", "8x8", "--methods", "path", "independent=--integrator path --sampler independent")
    interrupted = start(tools, out, *options)
    checkpoint = out / "room/path/1.ckpt"
    deadline = time.time() + 120
    while not checkpoint.exists() and interrupted.poll() is None and time.time() < deadline:
        time.sleep(0.02)
    interrupted.send_signal(signal.SIGINT)
    text, errors = interrupted.communicate()
    assert interrupted.returncode == 130 and "interrupted; run the same command again to continue" in errors, text + errors
    assert checkpoint.exists() and not complete_runs(out), "the first run was over before it was interrupted"
    state = checkpoint.read_bytes()
    checkpoint.write_bytes(state[:100])
    _, errors = run(tools, out, *options, code=1)
    assert "1.ckpt" in errors, "the checkpoint is not read: " + errors
    checkpoint.write_bytes(state)
    run(tools, out, *options)
    assert len(complete_runs(out)) == 8 and not checkpoint.exists()


def main():
    tools = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="lobe-references-") as name:
        for check in (check_agreement, check_disagreement, check_resumed):
            check(tools, pathlib.Path(name) / check.__name__)
            print(check.__name__, "passed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
