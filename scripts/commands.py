"""What the scripts that call the tools have in common: these calls, the machine, options and the progress."""

import argparse
import fcntl
import math
import os
import pathlib
import platform
import shlex
import subprocess
import sys

TOOLS = ("loberender", "lobefit", "lobecompare")


def check_tools(parser, folder, names, option="--tools FOLDER"):
    for tool in (folder / name for name in names):
        if not (tool.is_file() and os.access(tool, os.X_OK)):
            parser.error(f"{tool}: no such tool; build it, or name its folder by {option}")


def lock(out):
    """Makes the folder, and ends the script if that fails or another one works in it. It is locked as long as the returned file is open."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        file = open(out / ".lock", "w")
    except OSError as e:
        sys.exit(f"{e.filename}: {e.strerror}; choose a folder that can be written")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        sys.exit(f"{out}: another command is working in this folder")
    return file


def output(*command, progress=False):
    """Runs a command and returns its output. Shows its diagnostics only if it fails, or at once with progress."""
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=None if progress else subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit((done.stderr or "").strip() or f"{command[0]} failed with code {done.returncode}")
    return done.stdout


def show_progress(text):
    """Redraws a line on a terminal; elsewhere, prints one."""
    if sys.stderr.isatty():
        print(f"\r{text}\033[K", end="", file=sys.stderr, flush=True)
    else:
        print(text, file=sys.stderr, flush=True)


def end_progress():
    """Clears the line on a terminal."""
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def interrupted(number, _):
    end_progress()
    print("interrupted; run the same command again to continue", file=sys.stderr)
    sys.exit(128 + number)


def machine():
    cpu = [line.split(":")[1].strip() for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line]
    return {"cpu": cpu[0] if cpu else platform.processor(), "cores": len(os.sched_getaffinity(0))}


def positive(number):
    """Converts a word to a positive number of this type."""
    def convert(text):
        try:
            value = number(text)
        except ValueError:
            value = 0
        if not 0 < value < math.inf:
            raise argparse.ArgumentTypeError(f"'{text}' is not a positive {'integer' if number is int else 'number'}")
        return value
    return convert


def named(text):
    name, sign, value = text.partition("=")
    if not (name and sign and value):
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=VALUE")
    if set(name) & set(":/"):  # which separate the build from the method, and folders
        raise argparse.ArgumentTypeError(f"a name has no ':' and no '/', not '{name}'")
    return name, value


def named_options(text):
    name, value = named(text)
    try:
        shlex.split(value)
    except ValueError as e:
        raise argparse.ArgumentTypeError(f"'{value}': {e}") from e
    return name, value
