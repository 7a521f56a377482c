#!/usr/bin/env python3
"""Counts the instructions of the main jobs of `isoform`, and compares them with the committed ones.

    benches/instructions.py [PROGRAM] [--only NAME,...] [--write]

Instructions do not depend on what else the machine does, so that a change of a hundredth is seen;
valgrind counts them (AVX2 but no AVX-512, one thread). PROGRAM is target/release/isoform where none
is named. A job that takes more than 1.5 times its count in instructions.json exits with 1; --write
replaces the counts.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent
COUNTS = HERE / "instructions.json"
ALARM = 1.5
# Files of the repository; {out} is a scratch folder.
PART = "examples/templates/testpart.hf --params -5,-4,-2,10,5,4,-2,-1.5,1.25,3,0.5,1.5"
JOBS = {
    "fit": "fit tests/data/fitting/testpart_noise0.01.xyz -t testpart -o {out}/fit.json",
    "mesh": f"mesh {PART} --size 0.4 -o {{out}}/mesh.msh",
    "patch": "parameterize {out}/sphere.json --box 0.5 --cover --tol 1e-3 -o {out}/patches.json",
    "triangulate": "triangulate examples/surfaces/roman.json --box 2 -o {out}/roman.obj",
    "recognize": "recognize tests/data/fitting/testpart_noise0.01.xyz -o {out}/entities.json",
    "implicitize": "implicitize examples/scans/ycb_065-d_cup.ply --cells 300 -o {out}/cup.json",
    "solid": f"brep {PART} -o {{out}}/part.step",
    "values": f"eval {PART} --points {{out}}/points.csv -o {{out}}/values.csv",
}


def instructions(program, job, out):
    (out / "sphere.json").write_text('{"F": "x^2 + y^2 + z^2 - 1/5"}')
    points = (ROOT / "tests/data/fitting/testpart_clean.xyz").read_text()
    (out / "points.csv").write_text(points.replace(" ", ","))
    arguments = job.format(out=out).split()
    arguments += ["--threads", "1", "--quiet", "--force"]
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}/callgrind", program]
    done = subprocess.run([*command, *arguments], cwd=ROOT, capture_output=True, text=True)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode not in (0, 3) or not found:
        sys.exit(f"{' '.join(arguments)}: exit {done.returncode}\n{done.stderr}")
    return int(found[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", nargs="?", default=ROOT / "target/release/isoform", type=pathlib.Path)
    parser.add_argument("--only", default=",".join(JOBS))
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    committed = json.loads(COUNTS.read_text()) if COUNTS.exists() else {}
    counts, slower = dict(committed), []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.only.split(","):
            n = instructions(options.program.resolve(), JOBS[name], pathlib.Path(folder))
            ratio = n / committed.get(name, n)
            print(f"{name:12} {n / 1e6:10.1f} million  {ratio:6.3f} of the committed", flush=True)
            counts[name] = n
            if ratio > ALARM:
                slower.append(name)
    if options.write:
        COUNTS.write_text(json.dumps(counts, indent=2) + "\n")
    elif slower:
        sys.exit(f"more than {ALARM} times as many: {', '.join(slower)}")


if __name__ == "__main__":
    main()
