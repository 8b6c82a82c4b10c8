"""Charts by Matplotlib as SVG files. It is imported only when one is drawn, so that tables do not need it."""

import argparse
import pathlib
import sys

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "docs/charts"


def subplots(*arguments, **options):
    """The figure and the axes of Matplotlib."""
    import matplotlib
    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "lobe"  # the same data give the same file
    from matplotlib import pyplot
    return pyplot.subplots(*arguments, **options)


def save(figure, path, title, description):
    """Writes the chart with the title and the description that scripts/report --chart shows."""
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None, "Title": title, "Description": description})
    print(f"chart: {path}", file=sys.stderr)


def svg_file(text):
    if not text.endswith(".svg"):
        raise argparse.ArgumentTypeError(f"'{text}' must end in .svg")
    return pathlib.Path(text)
