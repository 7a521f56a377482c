#!/usr/bin/env python3
"""Writes the table of docs/recognize.md: recognition and recovery on public benchmarks.

    recognition.py PROGRAM [--checks DIR] [--noise 0,5e-4,5e-3]

The clouds and parts lie outside of the repository, with the scripts that measure them (DIR, by
default ../shared/checks; bench_recover.py needs cadquery-ocp). Published figures stand here.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/recognize.md"
START, END = "<!-- table of benchmarks -->\n", "<!-- end of the table -->\n"


def output(checks, script, *arguments):
    """What a script prints; its exit code says how many rows hold."""
    command = [sys.executable, checks / script, *arguments]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True).stdout


def found(pattern, text):
    """The groups of a pattern in what was printed."""
    match = re.search(pattern, text)
    if not match:
        raise SystemExit(f"nothing like {pattern!r} was printed:\n{text[-2000:]}")
    return match.groups()


def rows(checks, program, noises):
    """The rows of the table."""
    text = output(checks, "bench_recognize.py", "--isoform", program, "--set", "fit4cad")
    dice, high, count, seconds = found(
        r"mean Dice ([\d.]+), (\d+) of (\d+) faces above .9, median ([\d.]+) s", text
    )
    yield (
        "Fit4CAD, 18 training clouds: mean Dice of faces",
        f"{dice}; {high} of {count} faces above 0.9; median {seconds} s",
        "0.905 (Hough transform), 0.650 (primitive growing), on 35 test clouds",
    )
    text = output(checks, "bench_recognize.py", "--isoform", program, "--set", "shrec22")
    right, count, seconds = found(r"shrec22: (\d+) of (\d+) right, median ([\d.]+) s", text)
    yield (
        "SHREC 2022, 32 training clouds: right kind",
        f"{right} of {count}; median {seconds} s",
        "98.4 % on 925 test clouds",
    )
    text = output(checks, "bench_recover.py", "--isoform", program, "--noise", noises)
    for noise in noises.split(","):
        cells = found(rf"\n\| {float(noise):g} \| (.*) \|", text)[0].split(" | ")
        solids, iou, _, _, accepted, wrong, _, edits, seconds = cells
        yield (
            f"40 mechanical parts of a gallery, noise {100 * float(noise):g} % of the diagonal",
            f"{solids} valid solids; mean IoU {iou} (none counts 0); {accepted} accepted, {wrong} "
            f"of them wrong; {edits} of edits give a solid; median {seconds} s",
            "99.5 to 100 % solids, IoU 0.88 (CAD-Recode, CADFit, without intervals)",
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("--checks", type=Path, default=ROOT / "../shared/checks")
    parser.add_argument("--noise", default="0,5e-4,5e-3")
    given = parser.parse_args()
    table = "| benchmark | Isoform | published |\n|---|---|---|\n"
    for row in rows(given.checks, given.program.resolve(), given.noise):
        table += "| " + " | ".join(row) + " |\n"
    before, rest = PAGE.read_text().split(START)
    PAGE.write_text(before + START + table + END + rest.split(END)[1])
    print(table, end="")


if __name__ == "__main__":
    main()
