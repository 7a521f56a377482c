#!/usr/bin/env python3
"""isoform mesh beside CGAL's Mesh_3 and fidget, and values of functions beside fidget: the tables of docs/meshing-speed.md.

    benches/peers/run.py [tets] [surface] [growth] [blocks] [values] [--repeat N] [--to SIZE]

needs cargo, g++ and CGAL's headers (Debian: libcgal-dev libmpfr-dev), Linux, and an idle machine. Everything is built, then every tool is
run after the other. Times are those of the whole process without writing a file (user + system, the best of N), memory is the most that
was resident; one more run, not timed, writes the mesh, and target/release/measure measures all of them alike. Only the parts of `values`
are timed within the process, by src/bin/values.rs. Neither it nor `blocks`, which is timed once with its files, needs CGAL.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]

# Edge lengths: of isoform, and of CGAL so that it comes to as many tetrahedra.
TETS = {"part": (0.25, 0.1975), "sphere": (0.08, 0.064), "blend": (0.14, 0.1127), "gyroid": (0.05, 0.0393)}
# Depths of fidget's octree, and edge lengths of isoform that come to as many triangles.
SURFACE = {"part": (6, 0.263), "sphere": (6, 0.0316), "blend": (6, 0.1397), "gyroid": (5, 0.0443)}
# The part with about 1e5, 3e5, 1e6, 3e6, 1e7 tetrahedra.
GROWTH = [0.245, 0.1685, 0.1125, 0.0778, 0.052]
# A hundred million, in blocks along x, y and z.
BLOCKS = (0.0239, "4,2,2")
# Primitives of a union, and random points at which it is computed: fewer where each takes long.
VALUES = {20: 100_000, 200: 100_000, 2_000: 100_000, 100_000: 2_000}
EVALUATORS = ["fidget-jit", "fidget-vm", "isoform-tape", "isoform-pieces", "isoform-eval"]
# isoform-eval runs programs statement by statement: beyond so many primitives it takes minutes, and grows as before.
EVAL_MOST = 2_000
# Single precision differs from double by less than this: distances near primitives are below 1.
SINGLE = 2e-6


def folder(where):
    """Where cargo puts the programs of that workspace."""
    return pathlib.Path(os.environ.get("CARGO_TARGET_DIR", where / "target")) / "release"


ISOFORM, PEERS = folder(ROOT) / "isoform", folder(HERE)
OUT = PEERS / "peers-out"


def build(what):
    OUT.mkdir(parents=True, exist_ok=True)
    if what - {"blocks"}:
        subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=HERE, check=True)
    if what - {"values"}:
        subprocess.run(["cargo", "build", "--release", "--quiet", "-p", "isoform-cli"], cwd=ROOT, check=True)
    if not what - {"values", "blocks"}:
        return
    source, program = HERE / "cgal_mesher.cpp", OUT / "cgal_mesher"
    if not program.exists() or program.stat().st_mtime < source.stat().st_mtime:
        subprocess.run(["g++", "-std=c++17", "-O3", "-DNDEBUG", source, "-o", program, "-lmpfr", "-lgmp"], check=True)


def run(command, output=subprocess.DEVNULL):
    """(CPU seconds, wall seconds, MiB) of one process, whose output goes to a file"""
    start = time.perf_counter()
    child = subprocess.Popen([str(c) for c in command], stdout=output, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    wall = time.perf_counter() - start
    child.returncode = os.waitstatus_to_exitcode(status)
    # 3: the mesh is there, but its certificate does not hold or something is left unproved.
    if child.returncode not in (0, 3):
        raise SystemExit(f"exit {child.returncode}: {' '.join(map(str, command))}")
    return used.ru_utime + used.ru_stime, wall, used.ru_maxrss / 1024


def best(command, repeat):
    runs = [run(command) for _ in range(repeat)]
    return tuple(min(column) for column in zip(*runs))


def measure(path):
    return json.loads(subprocess.run([PEERS / "measure", path], check=True, capture_output=True).stdout)


def command(name, size, *more):
    return [ISOFORM, "mesh", HERE / "models" / f"{name}.hf", "--size", size, "--quiet", *more]


def mesher(name, size, threads, what, *out):
    return [PEERS / "isoform_mesher", HERE / "models" / f"{name}.hf", size, threads, what, *out]


def table(*head):
    print("\n| " + " | ".join(head) + " |\n|" + "---|" * len(head), flush=True)


def row(*cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def angles(pair):
    return f"{pair[0]:.2f} – {pair[1]:.1f}"


def rows(tools, elements, quality):
    """One row for every (tool, command, mesh as measured, times); ratios per element to the first of them."""
    unit = None
    for tool, mesh, (cpu, wall, memory) in tools:
        n = mesh[elements]
        unit = unit or cpu / n
        row(tool, f"{n:,}", angles(mesh[quality]), f"{cpu:.3f}", f"{wall:.3f}", f"{memory:.0f}", f"{cpu / n / unit:.2f}")


def tets(repeat):
    for name, (size, cgal_size) in TETS.items():
        table(name, "tets", "dihedral, degrees", "CPU s", "wall s", "peak MiB", "CPU per tet")
        ours, theirs, curves = OUT / "isoform.raw", OUT / "cgal.raw", OUT / "curves"
        run(mesher(name, size, 1, "volume", ours, curves))
        mesh = measure(ours)
        tools = [("isoform, mesher alone", mesh, best(mesher(name, size, 1, "volume"), repeat)),
                 ("isoform mesh, with certificate", mesh, best(command(name, size, "--threads", 1), repeat)),
                 ("the same, all threads", mesh, best(command(name, size), repeat))]
        for tool, how in (("CGAL raw", "raw"), ("CGAL perturb + exude", "optimised")):
            cgal = [OUT / "cgal_mesher", name, cgal_size, how]
            run([*cgal, theirs, curves])
            tools.append((tool, measure(theirs), best([*cgal, "-", curves], repeat)))
        rows(tools, "tets", "dihedral")


def surface(repeat):
    for name, (depth, size) in SURFACE.items():
        table(name, "triangles", "angles, degrees", "CPU s", "wall s", "peak MiB", "CPU per triangle")
        out = OUT / "surface.raw"
        tools = []
        for how in ("jit", "vm"):
            fidget = [PEERS / "fidget_mesher", name, depth, 1, how]
            run([*fidget, out])
            tools.append((f"fidget, {how}", measure(out), best(fidget, repeat)))
        run(mesher(name, size, 1, "surface", out))
        mesh = measure(out)
        tools.append(("isoform, mesher alone", mesh, best(mesher(name, size, 1, "surface"), repeat)))
        tools.append(("isoform mesh, with certificate", mesh, best(command(name, size, "--surface-only", "--threads", 1), repeat)))
        # The faster of fidget's evaluators comes first: ratios are to it.
        tools[:2] = sorted(tools[:2], key=lambda tool: tool[2][0])
        rows(tools, "triangles", "angle")


def growth(repeat, to):
    threads = len(os.sched_getaffinity(0))
    table("size", "tets", "dihedral, degrees", "mesher: CPU s", "wall s", "peak MiB", "tets per CPU s",
          "with certificate: CPU s", "wall s", "peak MiB", "tets per CPU s")
    for size in (s for s in GROWTH if s >= to):
        out = OUT / "growth.raw"
        run(mesher("part", size, threads, "volume", out))
        mesh = measure(out)
        out.unlink()
        n = mesh["tets"]
        many = repeat if n < 2e6 else 1
        cells = []
        for what in (mesher("part", size, threads, "volume"), command("part", size)):
            cpu, wall, memory = best(what, many)
            cells += [f"{cpu:.2f}", f"{wall:.2f}", f"{memory:.0f}", f"{n / cpu:,.0f}"]
        row(f"{size}", f"{n:,}", angles(mesh["dihedral"]), *cells)


def blocks():
    size, counts = BLOCKS
    table("size", "blocks", "tets", "dihedral, degrees", "certificate", "CPU s", "wall s", "peak MiB", "written MiB")
    folder = OUT / "blocks"
    folder.mkdir(exist_ok=True)
    with open(folder / "told.json", "w") as told:
        cpu, wall, memory = run(command("part", size, "--blocks", counts, "--json", "--force", "-o", folder / "part.pvtu"), told)
    found = json.loads((folder / "told.json").read_text())["certificate"]
    written = sum(p.stat().st_size for p in folder.glob("part*")) / 2**20
    row(f"{size}", counts, f"{found['tets']:,}", angles(found["dihedral_angles"]), "holds" if found["ok"] else "fails",
        f"{cpu:.0f}", f"{wall:.0f}", f"{memory:.0f}", f"{written:,.0f}")
    shutil.rmtree(folder)


def told(kind, n, evaluator, points):
    """(what the evaluator says of itself, or why it says nothing; MiB)"""
    with subprocess.Popen([PEERS / "values", kind, str(n), evaluator, str(points)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        # Neither is longer than a pipe holds.
        out, why = child.stdout.read(), child.stderr.read().decode().strip()
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    failure = None if child.returncode == 0 else f"exit {child.returncode}: {why.splitlines()[-1] if why else ''}"
    return failure or json.loads(out), used.ru_maxrss / 1024


def digits(value):
    """three of them"""
    return f"{float(f'{value:.3g}'):,.10g}"


def values():
    for kind in ("balls", "blocks"):
        for n, points in VALUES.items():
            table(f"{n:,} {kind}", "ready: CPU ms", f"{points:,} points: CPU ms", "ns per point", "ratio", "a cube: CPU ms", "ns per point", "ratio", "peak MiB")
            first = None
            for evaluator in EVALUATORS if n <= EVAL_MOST else EVALUATORS[:-1]:
                found, memory = told(kind, n, evaluator, points)
                if isinstance(found, str):
                    row(evaluator, found, *["–"] * 6, f"{memory:.0f}")
                    continue
                first = first or found
                # isoform-eval computes no cubes, which would take too long.
                if any(abs(a - b) > SINGLE for a, b in zip(found["values"], first["values"])):
                    raise SystemExit(f"{evaluator} differs: {found['values']}, {first['values']}")
                cells = [digits(1e3 * found["ready"])]
                for what, count in (("random", points), ("cube", found["cube_points"])):
                    seconds = found[what]
                    shown = [digits(1e3 * seconds), digits(1e9 * seconds / count), f"{seconds / first[what]:.2f}"] if seconds else ["–"] * 3
                    cells += shown
                row(evaluator, *cells, f"{memory:.0f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", help="tets, surface, growth, blocks, values; all of them if none is named")
    parser.add_argument("--repeat", type=int, default=3, help="runs of which the best counts (growth: one beyond 2 million)")
    parser.add_argument("--to", type=float, default=0.0, help="growth: no edge length below this one")
    args = parser.parse_args()
    works = {"tets": tets, "surface": surface, "growth": lambda repeat: growth(repeat, args.to), "blocks": lambda _: blocks(), "values": lambda _: values()}
    asked = {*args.what} or {*works}
    build(asked)
    for name, work in works.items():
        if name in asked:
            print(f"\nload {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} cores before `{name}`", flush=True)
            work(args.repeat)


if __name__ == "__main__":
    main()
