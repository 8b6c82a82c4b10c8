"""Tools that only pretend to fit, render and compare, for tests of scripts. CACHE is the content of every cache, SCENE_HASH the hash of every
scene, RENDER_SECONDS how long a picture takes. RANGE is how much the relative variance of a pair grows with the sum of its seeds. FIRST_RELMSE
is the error of the first snapshots. The tool called REPLACED is another one after each of its calls. The statistics lack the one called
MISSING. The pictures of a peer are darker, and those of the method black are black. Caches that are broken cannot be fitted."""

import json
import os
import pathlib
import struct
import sys
import time
import zlib

TOOL = f"""#!{sys.executable}
import sys
sys.path.insert(0, {str(pathlib.Path(__file__).resolve().parent)!r})
sys.dont_write_bytecode = True
import pretended_tools
pretended_tools.NAME(sys.argv[1:])
"""


def make(folder, names=("loberender", "lobefit", "lobecompare")):
    """Writes the tools into a new folder."""
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).write_text(TOOL.replace("NAME", name.replace("-", "_")))
        (folder / name).chmod(0o755)


def replace(tool):
    if os.environ.get("REPLACED") == tool:
        with open(sys.argv[0], "a") as file:
            file.write("\n")


def loberender(arguments):
    if arguments == ["--version"]:
        return print("loberender 0.0.0")
    replace("loberender")
    for snapshot in range(3 if "--snapshot-every" in arguments else 1):
        write_outputs(arguments, 1 + snapshot)
        time.sleep(1 if "--snapshot-every" in arguments else float(os.environ.get("RENDER_SECONDS", "0")))


def write_outputs(arguments, samples):
    for option, value in zip(arguments, arguments[1:]):
        if option == "-o" and value.endswith(".png"):
            pathlib.Path(value).write_bytes(png(64, 40))
        elif option == "-o":
            pathlib.Path(value).write_text(" ".join(arguments))
        elif option == "--stats":
            numbers = ("seconds_total", "seconds_training", "seconds_rendering", "spp", "rays", "path_segments", "segments_per_second",
                       "mean_path_length", "records", "training_particles", "peak_rss_bytes")
            stats = {"integrator": "path", "scene_hash": os.environ["SCENE_HASH"]} | {key: samples for key in numbers}
            stats.pop(os.environ.get("MISSING"), None)
            # At once, because scripts/bench-long-run reads it meanwhile.
            pathlib.Path(f"{value}.tmp").write_text(json.dumps(stats))
            pathlib.Path(f"{value}.tmp").replace(value)


def lobefit(arguments):
    replace("lobefit")
    file = pathlib.Path(arguments[arguments.index("-o") + 1]) / "a.lobe"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(os.environ["CACHE"])
    if os.environ["CACHE"] == "broken":
        sys.exit("the lobe cannot be fitted")
    print(json.dumps([{"file": str(file), "lobe": "a", "up_to_date": False, "seconds": 0.1}]))


def lobecompare(arguments):
    replace("lobecompare")
    if "--merge" in arguments:
        for option in ("--merge", "--variance"):
            pathlib.Path(arguments[arguments.index(option) + 1]).write_text(option)
        return
    if "--agree-with" in arguments:
        return print(json.dumps({"agree": True, "mean_ratio": 1, "mean_ratio_error": 0.1, "worst_z": 1, "limit_z": 4, "worst_at": [0, 0]}))
    if "--png" in arguments or "--map" in arguments:
        return pathlib.Path(arguments[-1]).write_bytes(png(64, 40))
    pictures = [word for word in arguments if not word.startswith("--")]
    if "--pair" not in arguments:
        relmse = {picture: float(os.environ.get("FIRST_RELMSE", 0.02)) if picture.endswith("-0.exr") else 0.02 for picture in pictures}
        means = {picture: 0 if "/a_black-" in picture else 0.7 if "/peer/" in picture else 1 for picture in pictures}
        reference = means[pictures[0]]
        return print(json.dumps([{"relmse": relmse[picture], "mean_ratio": means[picture] / reference if reference else None}
                                 for picture in pictures[1:]]))
    seeds = sum(int(pathlib.Path(picture).stem.rpartition("-")[2]) for picture in pictures)
    value = 0.02 if "/a_path-" in pictures[0] or "/path/" in pictures[0] else 0.0118 if "/a_method-" in pictures[0] else 0.01
    value *= 1 + float(os.environ.get("RANGE", "0")) * (seeds - 3)
    print(json.dumps({"mean_ratio": 1} | {key: number for name in ("relvar", "relvar_drop_1pct", "relvar_drop_0.1pct")
                                          for key, number in ((name, value), (f"{name}_interval", [0.9 * value, 1.1 * value]))}))


def png(width, height):
    """A grey picture."""
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    lines = height * (b"\0" + width * b"\x80\x80\x80")
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) + \
        chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
