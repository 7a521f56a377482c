"""The licences of the crates that are linked into a package of this repository, as one text.

    python3 scripts/third_party.py PACKAGE TARGET > THIRD-PARTY.txt
"""

import json
import subprocess
import sys
from pathlib import Path

NOTICES = ("licen[cs]e*", "copying*", "notice*", "unlicense*", "copyright*")


def linked(metadata, name):
    """The foreign packages that end up in the package `name`: no build scripts, no macros."""
    packages = {p["id"]: p for p in metadata["packages"]}
    nodes = {n["id"]: n for n in metadata["resolve"]["nodes"]}
    todo = [i for i in metadata["workspace_members"] if packages[i]["name"] == name]
    seen = set(todo)
    while todo:
        for dep in nodes[todo.pop()]["deps"]:
            used = packages[dep["pkg"]]
            macro = any("proc-macro" in t["kind"] for t in used["targets"])
            normal = any(k["kind"] is None for k in dep["dep_kinds"])
            if normal and not macro and used["id"] not in seen:
                seen.add(used["id"])
                todo.append(used["id"])
    foreign = [packages[i] for i in seen if packages[i]["source"]]
    return sorted(foreign, key=lambda p: (p["name"], p["version"]))


def notices(package):
    """The texts of a package's licences and notices."""
    folder = Path(package["manifest_path"]).parent
    files = {
        file
        for file in folder.iterdir()
        for pattern in NOTICES
        if file.is_file() and Path(file.name.lower()).match(pattern)
    }
    for file in sorted(files):
        text = file.read_text(encoding="utf-8", errors="replace")
        yield "\n".join(line.rstrip() for line in text.splitlines()).strip()


def main(name, target):
    command = ["cargo", "metadata", "--locked", "--format-version=1", "--filter-platform", target]
    packages = linked(json.loads(subprocess.check_output(command)), name)
    print("Isoform contains parts of these packages:\n")
    of_text = {}
    for package in packages:
        title = f"{package['name']} {package['version']}"
        print(f"  {title}: {package['license'] or package['license_file']}")
        for text in notices(package):
            of_text.setdefault(text, []).append(title)
    print("\nand of the standard library of Rust (MIT OR Apache-2.0). Their notices:")
    for text, titles in of_text.items():
        print(f"\n{'-' * 80}\n{', '.join(dict.fromkeys(titles))}\n\n{text}")


if __name__ == "__main__":
    main(*sys.argv[1:])
