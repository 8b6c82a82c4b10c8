#!/usr/bin/python3
"""Reads pictures of loberender and lobecompare with another program, OpenImageIO's oiiotool: the names and types of their channels, the
compression, and values of AOVs.

The argument is the folder of the tools. Exits with 77 if oiiotool is not installed.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77
CHANNELS = ["R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "depth.Z", "normal.X", "normal.Y", "normal.Z", "samples.Y", "variance.R",
            "variance.G", "variance.B"]
PRECISE = ("depth", "samples", "variance")
# A grey wall at a distance of 4, in front of which is nothing.
SCENE = """<scene version="3.0.0">
  <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film>
    <float name="fov" value="40"/></sensor>
  <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate y="1" angle="180"/><translate z="4"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.25, 0.5, 0.75"/></bsdf></shape>
  <emitter type="constant"/>
</scene>"""


def call(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def channels_of(picture):
    """The names of the channels with their types, and the compression."""
    text = call("oiiotool", "--info", "-v", picture)
    names = re.search(r"channel list: (.*)", text)[1].split(", ")
    common = re.search(r"\d+ channel, (\w+) openexr", text)
    channels = {}
    for name in names:
        typed = re.fullmatch(r"(\S+) \((\w+)\)", name)
        channels[typed[1] if typed else name] = typed[2] if typed else common[1]
    return channels, re.search(r'compression: "(\w+)"', text)[1]


def means_of(picture):
    """The mean of each channel."""
    text = call("oiiotool", "--stats", picture)
    assert not any(float(count) for kind in ("NanCount", "InfCount") for count in re.search(rf"{kind}:(.*)", text)[1].split()), text
    return dict(zip(CHANNELS, map(float, re.search(r"Stats Avg:([ \d.e+-]*)", text)[1].split())))


def check_means(picture, samples):
    means = means_of(picture)
    expected = {"albedo.R": 0.25, "albedo.G": 0.5, "albedo.B": 0.75, "normal.X": 0, "normal.Y": 0, "normal.Z": -1, "depth.Z": 4,
                "samples.Y": samples}
    for name, value in expected.items():
        assert abs(means[name] - value) < 1e-3, f"{picture}: {name} is {means[name]}, expected {value}"


def main():
    if not shutil.which("oiiotool"):
        print("skipped: oiiotool is not installed (openimageio-tools)")
        return SKIPPED
    tools = pathlib.Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "scene.xml").write_text(SCENE)
        render = [tools / "loberender", folder / "scene.xml", "--integrator", "path", "--aov", "all", "--spp", "2"]
        call(*render, "-o", folder / "a.exr")
        assert channels_of(folder / "a.exr") == ({name: "float" for name in CHANNELS}, "zip"), channels_of(folder / "a.exr")
        check_means(folder / "a.exr", 2)
        call(*render, "-o", folder / "b.exr", "--sample-offset", "2", "--exr-type", "half", "--exr-compression", "piz")
        halves = {name: "float" if name.startswith(PRECISE) else "half" for name in CHANNELS}
        assert channels_of(folder / "b.exr") == (halves, "piz"), channels_of(folder / "b.exr")
        check_means(folder / "b.exr", 2)
        call(tools / "lobecompare", "--merge", folder / "c.exr", folder / "a.exr", folder / "b.exr", "--exr-compression", "zips")
        assert channels_of(folder / "c.exr") == ({name: "float" for name in CHANNELS}, "zips"), channels_of(folder / "c.exr")
        check_means(folder / "c.exr", 4)
    return 0


if __name__ == "__main__":
    sys.exit(main())
