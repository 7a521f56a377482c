"""Folders of acceptance data with fewer cases: fewer_cases.py LIST SHARED FOLDER.

A line `data | PLACE | FILE FILE:N ...` of LIST makes FOLDER/PLACE of these files of SHARED/PLACE:
links, or with N the first N lines of a text, N items of each list of a .json; of shapes.py N shapes
whose intervals are tried and N + 1 to tell apart. Next to them lie links to what they refer to.
"""
import json
import sys
from pathlib import Path

listing, shared, folder = (Path(a).resolve() for a in sys.argv[1:])


def first(cases, n):
    if isinstance(cases, dict):
        return {k: v[:n] if isinstance(v, list) else v for k, v in cases.items()}
    return cases[:n]


def fewer(source, n):
    text = source.read_text()
    if source.suffix == ".json":
        return json.dumps(first(json.loads(text), n))
    if source.suffix == ".py":
        return f"{text}\nCOVERAGE, VERDICTS = COVERAGE[:{n}], VERDICTS[:{n + 1}]\n"
    return "".join(text.splitlines(keepends=True)[:n])


folder.mkdir(parents=True, exist_ok=True)
for name in ("data", "hyperfun", "models"):
    (folder / name).symlink_to(shared / name)
for line in listing.read_text().splitlines():
    kind, *fields = (word.strip() for word in line.split(" | "))
    if kind != "data":
        continue
    place, words = fields
    (folder / place).mkdir(parents=True, exist_ok=True)
    for word in words.split():
        pattern, _, n = word.partition(":")
        sources = sorted((shared / place).glob(pattern))
        if not sources:
            sys.exit(f"{listing}: no {pattern} in {shared / place}")
        for source in sources:
            target = folder / place / source.name
            if n:
                target.write_text(fewer(source, int(n)))
            else:
                target.symlink_to(source)
