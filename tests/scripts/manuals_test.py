#!/usr/bin/python3
"""Checks the man pages and completions of scripts/make-manuals: every option of --help is in each of them, their syntax is right, and bash
completes options, values and files. groff, zsh and fish are used where they are installed.

The arguments are the folder of the tools and that of the man pages and completions.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

TOOLS = ("lobefit", "lobedump", "loberender", "lobecompare")
# Prints what bash offers for the last of the words, one to a line.
COMPLETE = """
source "$1"; shift
complete -p "$1" >/dev/null || exit 1
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
"_$1" "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


def options_of(tool):
    """The names of the options, read from the help text in another way than that of scripts/make-manuals."""
    text = subprocess.run([tool, "--help"], check=True, capture_output=True, text=True).stdout
    names = [name for line in re.findall(r"^  (-\S+)", text, re.MULTILINE) for name in line.split(",")]
    assert "--help" in names and len(names) > 5, text
    return names


def check_options(tool, folder):
    """That each file has each option as a word, in the form of its language."""
    manual = (folder / f"{tool.name}.1").read_text().replace("\\-", "-")
    bash = (folder / f"{tool.name}.bash").read_text()
    zsh = (folder / f"_{tool.name}").read_text()
    fish = (folder / f"{tool.name}.fish").read_text()
    for name in options_of(tool):
        assert f"\\fB{name}\\fR" in manual, f"{name} is not in the man page of {tool.name}"
        assert re.search(rf"[' ]{name}[' ]", bash), f"{name} is not completed by bash for {tool.name}"
        assert re.search(rf"['*)]{name}[=+]?\[", zsh), f"{name} is not completed by zsh for {tool.name}"
        assert f" -l {name[2:]} " in fish if name.startswith("--") else f" -s {name[1:]} " in fish, f"{name} is not completed by fish for {tool.name}"


def check_syntax(folder):
    for program, options, pattern in (("bash", ["-n"], "*.bash"), ("zsh", ["-n"], "_*"), ("fish", ["-n"], "*.fish"),
                                      ("groff", ["-man", "-ww", "-Tutf8", "-z"], "*.1")):
        if not shutil.which(program):
            print(f"{program} is not installed, so {pattern} are not checked with it")
            continue
        for file in folder.glob(pattern):
            done = subprocess.run([program, *options, file], capture_output=True, text=True)
            assert done.returncode == 0 and not done.stderr, f"{file}: {done.stderr}"


def complete(folder, *words):
    with tempfile.TemporaryDirectory() as name:
        for file in ("a scene.xml", "scene.illum", "gold.lobe", "picture.exr"):
            (pathlib.Path(name) / file).touch()
        (pathlib.Path(name) / "lobes").mkdir()
        done = subprocess.run(["bash", "-c", COMPLETE, "bash", folder / f"{words[0]}.bash", *words], cwd=name, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return set(filter(None, done.stdout.split("\n")))


def check_bash(folder):
    for words, expected in ((("loberender", "--samp"), {"--sample-offset", "--sampler"}),
                            (("loberender", "--integrator", "p"), {"path", "product"}),
                            (("loberender", "--integrator", "=", "b"), {"bdpt"}),
                            (("loberender", "--sampler", "="), {"sobol", "independent"}),
                            (("loberender", ""), {"a scene.xml", "lobes"}),
                            (("loberender", "--cache", ""), {"lobes"}),
                            (("loberender", "--spp", ""), set()),
                            (("lobedump", "--records", ""), {"scene.illum", "gold.lobe", "lobes"}),
                            (("lobecompare", "p"), {"picture.exr"})):
        offered = complete(folder, *words)
        assert offered == expected, f"{' '.join(words)}: offers {offered}"


def main():
    tools, folder = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    for tool in TOOLS:
        check_options(tools / tool, folder)
    check_syntax(folder)
    check_bash(folder)
    print("the man pages and completions have all options")


if __name__ == "__main__":
    main()
