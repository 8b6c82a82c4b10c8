"""What the scripts that measure and show errors have in common."""

import importlib.machinery
import importlib.util
import json
import math
import pathlib
import sys


def load_evaluate():
    """The module scripts/evaluate, whose name has no suffix."""
    loader = importlib.machinery.SourceFileLoader("evaluate", str(pathlib.Path(__file__).with_name("evaluate")))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("evaluate", loader))
    loader.exec_module(module)
    return module


def read_summary(out):
    """The content of summary.json in a folder of scripts/evaluate."""
    try:
        return json.loads((out / "summary.json").read_text())
    except FileNotFoundError as e:
        sys.exit(f"{e.filename}: not found; run scripts/evaluate {out} first")


def rank(budget):
    """Orders budgets: seconds above samples per pixel, which are not comparable, then by the amount; imported pictures have none."""
    kind, _, amount = budget.partition(" ")
    return kind == "seconds", float(amount or 0)


def at_largest_budget(summary):
    """(scene, method) → its results at the largest budget."""
    largest = {}
    for one in summary:
        key = one["scene"], one["method"]
        if key not in largest or rank(one["budget"]) > rank(largest[key]["budget"]):
            largest[key] = one
    return largest


def without_imported(summary):
    return [one for one in summary if one["budget"] != "imported"]


def budget_text(budget):
    kind, amount = budget.split(" ")
    return f"{amount} s" if kind == "seconds" else f"{amount} samples"


def slope(x, y):
    """That of the least-squares line through the logarithms."""
    x, y = [math.log(value) for value in x], [math.log(value) for value in y]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    return sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)
