"""The scenes and methods of scripts/evaluate, which other scripts also use."""

import os
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
METHODS = {
    "path": "--integrator path",
    "guided": "--integrator guided",
    "product": "--integrator product",
    "product-naive": "--integrator product --bsdf-fraction fixed --russian-roulette throughput --light-paths off",
    "auto": "--integrator auto",
    "bdpt": "--integrator bdpt",
    "bdpt-product": "--integrator bdpt --guide product",
    "vcm": "--integrator vcm",
    "product-light": "--integrator product --light-paths on",
    "path-gradients": "--integrator path --gradients l2",
    "product-gradients": "--integrator product --gradients l2",
    "bdpt-gradients": "--integrator bdpt --gradients l2",
}
# Of the pictures.
SIZES = {"kitchen": "350x200", "kitchenette": "160x120", "living-room": "320x180", "dining-room": "320x180", "staircase2": "256x256",
         "cornell-box": "256x256", "veach-mis": "320x180", "jewelry": "240x150", "veach-ajar": "320x180", "veach-bidir": "256x256",
         "spaceship": "320x180", "living-room-2": "320x180", "own-livingroom": "320x200", "own-kitchen": "320x200",
         "own-kitchenette": "320x200"}


def is_own(name):
    """Whether it is a scene of this repository: its name begins with own-, except for jewelry."""
    return name == "jewelry" or name.startswith("own-")


def name_of_file(path):
    """The name of a scene file, or that of its folder for scene.xml."""
    return path.resolve().parent.name if path.stem == "scene" else path.stem


def scene_file(name):
    if is_own(name):
        return ROOT / "scenes" / (name.removeprefix("own-") + ".xml")
    return pathlib.Path(os.environ["LOBE_DATA"]) / name / "scene.xml"
