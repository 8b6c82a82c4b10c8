#!/usr/bin/python3
"""Makes a bundle of the tools and runs all of them in an empty root directory that has only the bundle, a shell with the C library, and a scene.

The argument is the folder of the tools. Exits with 77 if this user cannot change the root directory.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED = 77
FIT = ["--directions", "16", "--samples", "256"]
RENDER = ["--size", "32x24", "--spp", "4", "--passes", "1", "--photons", "3000", "--importons", "1500"]


def isolated(root, *command):
    return subprocess.run(["unshare", "--map-root-user", "--net", "chroot", root, *command], capture_output=True, text=True, env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"})


def make_root(folder):
    """A root directory with a shell."""
    shell = pathlib.Path("/bin/sh").resolve()
    for file in [*re.findall(r"(/\S+) \(0x", subprocess.run(["ldd", shell], check=True, capture_output=True, text=True).stdout), "/bin/sh"]:
        target = folder / file.lstrip("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, target)
    shutil.copytree(ROOT / "tests/data", folder / "data", ignore=shutil.ignore_patterns("*.exr"))


def check(root, tools):
    prefix = "/opt/" + next((root / "opt").iterdir()).name + "/bin/"

    def run(tool, *options):
        done = isolated(root, prefix + tool, *options)
        assert done.returncode == 0, f"{tool}: {done.stderr}"
        return done.stdout

    for tool in ("lobefit", "lobedump", "loberender", "lobecompare"):
        assert f"Usage: {tool}" in run(tool, "--help"), f"{tool} has another name in the bundle"
    licences = root / prefix.lstrip("/") / "../share/licenses"
    assert (licences / "lobe").exists() and (licences / "common/LGPL-2.1").exists(), "licences of the libraries are missing"
    run("lobefit", "/data/room.xml", "-o", "/lobes", *FIT)
    run("loberender", "/data/room.xml", "--cache", "/lobes", "-o", "/room.exr", *RENDER)
    assert "lobe" in run("lobedump", *(f"/lobes/{file.name}" for file in (root / "lobes").iterdir()))
    subprocess.run([tools / "loberender", ROOT / "tests/data/room.xml", "--cache", root / "lobes", "-o", root / "whole.exr", *RENDER], check=True)
    run("lobecompare", "/whole.exr", "/room.exr")
    assert (root / "whole.exr").read_bytes() == (root / "room.exr").read_bytes(), "the picture differs from that of the tools outside"


def main():
    tools = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="lobe-bundle-") as name:
        root = pathlib.Path(name) / "root"
        root.mkdir()
        if not shutil.which("unshare") or isolated("/", "/bin/sh", "-c", ":").returncode:
            print("skipped: this user cannot change the root directory (unshare --map-root-user)")
            return SKIPPED
        make_root(root)
        bundle = pathlib.Path(name) / "lobe.tar.gz"
        subprocess.run([ROOT / "scripts/bundle", "--tools", tools, "-o", bundle], check=True)
        (root / "opt").mkdir()
        shutil.unpack_archive(bundle, root / "opt")
        check(root, tools)
    print("the bundle works")
    return 0


if __name__ == "__main__":
    sys.exit(main())
