#!/usr/bin/python3
"""Makes references of a small scene: methods that agree give one reference with its variance, an interrupted run is resumed, and methods
that disagree are reported and both kept. Before, tools that only pretend to render show what is refused, repeated and ended.

The argument is the folder of the tools.
"""

import contextlib
import json
import os
import pathlib
import runpy
import signal
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
import pretended_tools  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
SCENE = ROOT / "tests/data/room.xml"
QUICK = "--passes 1 --photons 2000 --importons 1000 --russian-roulette throughput --light-paths off"


def start(tools, out, *options):
    command = [ROOT / "scripts/make-references", out, SCENE, *options, "--tools", tools, "--runs", "4"]
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


@contextlib.contextmanager
def rendering(tools, out, *options, picture):
    """Pretended tools that have written the picture, and are ended with the context before the run is complete."""
    os.environ["RENDER_SECONDS"] = "60"
    process = start(tools, out, *options)
    del os.environ["RENDER_SECONDS"]
    try:
        while not picture.exists():
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)
        time.sleep(0.1)  # until its statistics are written
        yield
    finally:
        process.terminate()
        process.communicate()


def check_names(tools, out):
    """What would write to the same files is refused before anything is rendered, as are other wrong options."""
    other = out.with_name("other") / "room.xml"
    other.parent.mkdir()
    other.write_bytes(SCENE.read_bytes())
    (other.parent / "room-variance.xml").write_bytes(SCENE.read_bytes())
    file = out.with_name("file")
    file.touch()

    def refused(text, *options, out=out, tools=tools):
        _, errors = run(tools, out, *options, code=2)
        assert text in errors and "Traceback" not in errors and not (out / "room").exists(), errors

    for method, text in (("path-variance=--integrator path", "is the name of other files"), ("caches=--integrator path", "is the name of other files"),
                         ("..=--integrator path", "is the name of other files"), ("=--integrator path", "is not NAME="),
                         ("a/b=--integrator path", "a name has no"), ("a=--integrator 'path", "No closing quotation"), ("other", "unknown method 'other'")):
        refused(text, "--methods", "path", method)
    refused("files of the same names would be written for", other)
    refused("files of the same names would be written for", other.parent / "room-variance.xml")
    refused("no such scene file", "kitchen")
    refused("is not a positive integer", "--threads", "0")
    refused("no such tool", tools=out)
    refused("is not a folder", out=file)


def check_gradients(tools, out):
    run(tools, out, "--spp", "1", "--methods", "path", "gradients=--integrator path --gradients=l2")
    assert "--checkpoint" not in (out / "room/gradients/2.exr").read_text() and "--checkpoint" in (out / "room/path/1.exr").read_text()


def check_deleted(tools, out):
    """A run of which a file was deleted is repeated, and not complete before its end."""
    options = ("--spp", "1", "--methods", "path", "guided")
    run(tools, out, *options)
    before = complete_runs(out)
    deleted = {out / "room/path/1.exr", out / "room/guided/4.json"}
    for file in deleted:
        file.unlink()
    run(tools, out, *options)
    after = complete_runs(out)
    assert {run for run in before if before[run] != after[run]} == {file.with_suffix(".run") for file in deleted}
    assert all(file.exists() for file in deleted)
    picture = out / "room/path/1.exr"
    picture.unlink()
    with rendering(tools, out, *options, picture=picture):
        pass
    assert picture.exists() and not picture.with_suffix(".run").exists()


def check_replaced(_, out):
    """Runs during which the tools were replaced are not taken for runs of the former ones."""
    tools = out.with_name("replaced")
    pretended_tools.make(tools)
    for tool in ("loberender", "lobefit", "lobecompare"):
        former = (tools / tool).read_text()
        os.environ["REPLACED"] = tool
        _, errors = run(tools, out, "--spp", "1", "--methods", "path", "guided", code=1)
        del os.environ["REPLACED"]
        assert f"{tools / tool} was replaced meanwhile" in errors, errors
        assert tool == "lobecompare" or not complete_runs(out) and not list(out.rglob("*.begun")), "a run is taken for one of the former tools"
        assert not (out / "references.json").exists()
        (tools / tool).write_text(former)
    run(tools, out, "--spp", "1", "--methods", "path", "guided")


def check_locked(tools, out):
    options = ("--spp", "1", "--methods", "path", "guided")
    with rendering(tools, out, *options, picture=out / "room/path/1.exr"):
        _, errors = run(tools, out, *options, code=1)
        assert "another command is working in this folder" in errors, errors


def check_copied(_, out):
    """Where there are no hard links, the reference is a copy."""
    out.mkdir()
    script = runpy.run_path(str(ROOT / "scripts/make-references"))

    def refuse(*_):
        raise PermissionError

    before, pathlib.Path.hardlink_to = pathlib.Path.hardlink_to, refuse
    try:
        for content in ("first", "second"):
            (out / "source").write_text(content)
            script["link"](out / "source", out / "target")
            assert (out / "target").read_text() == content
    finally:
        pathlib.Path.hardlink_to = before


def check_pretended(folder):
    tools = folder / "tools"
    pretended_tools.make(tools)
    os.environ |= {"CACHE": "first", "SCENE_HASH": "0a", "LOBE_DATA": str(folder)}
    for check in (check_names, check_gradients, check_deleted, check_replaced, check_locked, check_copied):
        check(tools, folder / check.__name__)
        print(check.__name__, "passed", flush=True)


def main():
    tools = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="lobe-references-") as name:
        check_pretended(pathlib.Path(name) / "pretended")
        for check in (check_agreement, check_disagreement, check_resumed):
            check(tools, pathlib.Path(name) / check.__name__)
            print(check.__name__, "passed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
