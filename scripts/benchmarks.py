"""What the scripts bench-* have in common: programs and their results, and scenes."""

import json
import os
import pathlib
import sys

import results
from commands import output
from scenes import name_of_file

ROOT = pathlib.Path(__file__).resolve().parent.parent
KEPT = ROOT / "build/bench"


def tool(name):
    path = ROOT / "build/release/bin" / name
    if not path.is_file():
        sys.exit(f"{path}: no such tool; build it first (scripts/setup)")
    return path


def measured(file, keep, *commands):
    """Runs the commands and returns the results of the last one, which are JSON. The file keeps them; with keep, they are read from it if they
    are those of the same commands and the same benchmark."""
    made_by = {"commands": [[str(part) for part in command] for command in commands], "benchmark": results.sha256(commands[-1][0])}
    if keep and (rows := kept(file, made_by)) is not None:
        return rows
    file.parent.mkdir(parents=True, exist_ok=True)
    *_, last = [output(*command, progress=True) for command in commands]
    rows = json.loads(last)
    results.write(file, json.dumps(made_by | {"rows": rows}))
    return rows


def kept(file, made_by):
    try:
        found = json.loads(file.read_text())
    except FileNotFoundError:
        return None
    return found["rows"] if isinstance(found, dict) and made_by.items() <= found.items() else None


def scene_file(name):
    """The file of a scene of LOBE_DATA, or one that ends in .xml and may be relative to this repository."""
    if name.endswith(".xml"):
        return ROOT / name if not pathlib.Path(name).exists() else pathlib.Path(name)
    if "LOBE_DATA" not in os.environ:
        sys.exit("LOBE_DATA is not set; set it to the folder of the scenes")
    return pathlib.Path(os.environ["LOBE_DATA"]) / name / "scene.xml"


def label_of(name):
    return name_of_file(pathlib.Path(name)) if name.endswith(".xml") else name


def parse(parser):
    """The options of the command line. Those after -- are for the benchmark."""
    given = sys.argv[1:]
    split = given.index("--") if "--" in given else len(given)
    arguments = parser.parse_args(given[:split])
    arguments.options = given[split + 1:]
    return arguments
