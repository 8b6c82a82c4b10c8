"""What the scripts that measure and show errors have in common."""

import collections
import csv
import hashlib
import io
import json
import math
import pathlib
import struct
import sys


def sha256(path):
    return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()


def sha256_of(names):
    """That of a dictionary, whatever its order."""
    return hashlib.sha256(json.dumps(names, sort_keys=True).encode()).hexdigest()


def write(path, text):
    """Replaces the file at once, so that an interruption leaves the old or the new content."""
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_text(text)
    temporary.replace(path)


def write_csv(path, rows):
    columns = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns)
    writer.writeheader()
    writer.writerows(rows)
    write(path, text.getvalue())


def exr_size(path):
    """The size of the display window as WxH, from the header of the file."""
    with open(path, "rb") as file:
        _, _, window = file.read(1 << 20).partition(b"displayWindow\0box2i\0" + struct.pack("<i", 16))
    if len(window) < 16:
        raise ValueError(f"{path} is not an EXR file")
    left, top, right, bottom = struct.unpack("<4i", window[:16])
    return f"{right - left + 1}x{bottom - top + 1}"


def is_biased(options):
    """Whether pictures by these options of loberender differ from the expected picture by more than noise."""
    text = " ".join(options).replace("=", " ")
    return any(biased in text for biased in ("--integrator vcm", "--gradients l1", "--firefly-limit"))


def read_output(out, name):
    """The text of a file in a folder of scripts/evaluate."""
    try:
        return (out / name).read_text()
    except FileNotFoundError as e:
        sys.exit(f"{e.filename}: not found; run scripts/evaluate {out} first")
    except NotADirectoryError:
        sys.exit(f"{out} is not a folder of scripts/evaluate")


def read_summary(out):
    return json.loads(read_output(out, "summary.json"))


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
    kind, _, amount = budget.partition(" ")
    return {"seconds": f"{amount} s", "spp": "1 sample" if amount == "1" else f"{amount} samples"}.get(kind, kind)


def rows_of(summary):
    """(scene, budget) → method → its results. Imported pictures stand in all rows of a scene, or in one of their own."""
    rows = collections.defaultdict(dict)
    for one in summary:
        budgets = {other["budget"]: None for other in summary if other["scene"] == one["scene"] and other["budget"] != "imported"}
        for budget in (budgets or ["imported"]) if one["budget"] == "imported" else [one["budget"]]:
            rows[one["scene"], budget][one["method"]] = one
    return rows


def methods_of(summary):
    return list(dict.fromkeys(one["method"] for one in summary))


def lowest(of_method):
    """The methods of a row whose variance is not above the lowest one by more than the uncertainties of both. Imported pictures, which have
    no budget, are not ranked."""
    ranked = {method: one for method, one in of_method.items() if one["budget"] != "imported"}
    best = min(ranked.values(), key=lambda one: one["trimmed"], default=None)
    return [method for method, one in ranked.items()
            if one["trimmed"] - (one["trimmed_spread"] or 0) <= best["trimmed"] + (best["trimmed_spread"] or 0)]


def digits(number, count=3):
    """The significant digits of a number, without an exponent unless it is very small; nothing if it is not known."""
    return "" if number is None else f"{float(f'{number:.{count}g}'):.12g}"


def variance(one):
    """Without the worst pixels, with its uncertainty."""
    return digits(one["trimmed"]) + (f" ± {digits(one['trimmed_spread'], 1)}" if one["trimmed_spread"] else "")


def print_table(header, rows):
    def line(cells):
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    print(line(header) + "\n" + "|---" * len(header) + "|")
    for row in rows:
        print(line(row))


def print_methods(rows, methods, label, text):
    """A row for each scene and budget, with the lowest in bold."""
    def cells(of_method):
        best = lowest(of_method)
        texts = {method: f"**{text(one)}**" if method in best else text(one) for method, one in of_method.items()}
        return [texts.get(method, "") for method in methods]

    print_table(["", *methods], [[label(scene, budget), *cells(of_method)] for (scene, budget), of_method in rows.items()])


def print_errors(summary):
    """All budgets, and in brackets the variance of all pixels."""
    print_methods(rows_of(summary), methods_of(summary), lambda scene, budget: f"{scene}, {budget_text(budget)}",
                  lambda one: f"{variance(one)} ({digits(one['all'])})")


def slope(x, y):
    """That of the least-squares line through the logarithms of all points with positive coordinates; NaN if there are not two different x."""
    points = [(math.log(a), math.log(b)) for a, b in zip(x, y) if a > 0 and b > 0]
    if len({a for a, _ in points}) < 2:
        return math.nan
    mean_x, mean_y = (sum(values) / len(points) for values in zip(*points))
    return sum((a - mean_x) * (b - mean_y) for a, b in points) / sum((a - mean_x) ** 2 for a, _ in points)
