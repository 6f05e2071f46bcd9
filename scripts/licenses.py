#!/usr/bin/env python3
"""The licence texts of the crates that are linked into a binary of this library, in one file.

    python3 scripts/licenses.py                 writes LICENSES-THIRD-PARTY
    python3 scripts/licenses.py --check         says what is out of date, and fails, if it is
    python3 scripts/licenses.py --package vehicle-gaussians-python --output bindings/python/LICENSES-THIRD-PARTY

Crates that only run while building (procedural macros, build scripts) are not listed. Where a crate offers a
choice of licences, one is taken: the first in PREFERRED. A crate without a text of its licence gets that of another
crate from the same repository. Needs Python 3.9, cargo and the crates of Cargo.lock, which cargo downloads.
"""

import argparse
import difflib
import json
import re
import subprocess
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Where the binary packages run.
TARGETS = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"]

# A licence, and sentences that its text has (white space and case do not count).
MARKS = {
    "MIT": ["Permission is hereby granted, free of charge", "the software is provided “as is”"],
    "Zlib": ["This software is provided 'as-is', without any express", "must not be misrepresented"],
    "0BSD": ["Permission to use, copy, modify, and/or distribute this software for any purpose"],
    "BSD-2-Clause": ["Redistributions in binary form must reproduce"],
    "BSD-3-Clause": ["Redistributions in binary form must reproduce", "Neither the name of"],
    "Apache-2.0": ["Apache License", "terms and conditions for use, reproduction, and distribution"],
    "Apache-2.0 WITH LLVM-exception": ["Apache License", "LLVM Exceptions to the Apache 2.0 License"],
    "Unicode-3.0": ["Unicode License V3", "and to permit persons to whom the data files or software"],
    "Unlicense": ["This is free and unencumbered software released into the public domain"],
    "OFL-1.1": ["SIL Open Font License Version 1.1"],
}

# Corrections of a crate's manifest: the licences of all its contents, and a file with a text that it lacks. As in deny.toml.
CLARIFIED = {"noto-sans-mono-bitmap": ("MIT AND OFL-1.1", ROOT / "scripts/OFL-1.1.txt")}

# Shortest and plainest first.
PREFERRED = list(MARKS)

RULE = "=" * 78

HEAD = """\
Third-party software in binaries of vehicle-gaussians

{what}
contains the Rust crates listed here, each under the licence named beside it;
their texts follow. The Rust standard library, also in it, is Copyright (c) The
Rust Project Contributors, under the MIT licence, whose terms are among the
texts; notices for its parts come with each Rust toolchain
(share/doc/rust/COPYRIGHT-library.html).

The licence of vehicle-gaussians itself is in LICENSE-MIT and LICENSE-APACHE.

Made by scripts/licenses.py from Cargo.lock. Do not edit.
"""


def cargo(*args):
    done = subprocess.run(["cargo", *args], stdout=subprocess.PIPE, text=True, encoding="utf-8")
    if done.returncode:
        sys.exit(f"licenses.py: failed: cargo {' '.join(args)}")
    return done.stdout


def linked(args):
    """(name, version) of every crate that cargo links, on any of the targets."""
    found = set()
    for target in args.target or TARGETS:
        tree = ["tree", "--locked", "--edges=normal,no-proc-macro", "--prefix=none", "--format={p}"]
        for line in cargo(*tree, f"--target={target}", *selection(args)).splitlines():
            name, version = line.split()[:2]
            found.add((name, version.removeprefix("v")))
    return found


def selection(args):
    chosen = [f"--package={args.package}"]
    if args.features:
        chosen.append(f"--features={args.features}")
    return chosen


def alternatives(expression):
    """The sets of licences that satisfy an SPDX expression: "(A OR B) AND C" is {A, C} or {B, C}."""
    expression = expression.replace("/", " OR ")
    tokens = re.findall(r"[()]|[\w.+-]+(?:\s+WITH\s+[\w.+-]+)?", expression)

    def either():
        sets = both()
        while tokens and tokens[0] == "OR":
            tokens.pop(0)
            sets = sets + both()
        return sets

    def both():
        sets = one()
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            other = one()
            sets = [a | b for a in sets for b in other]
        return sets

    def one():
        token = tokens.pop(0)
        if token == "(":
            sets = either()
            tokens.pop(0)
            return sets
        return [frozenset([token])]

    return either()


def choose(package):
    """The licences under which a crate is used, the preferred one first."""
    expression, _ = CLARIFIED.get(package["name"], (package["license"] or "", None))
    known = [s for s in alternatives(expression) if s <= MARKS.keys()]
    if not known:
        sys.exit(f"licenses.py: {package['name']}: no known licence in {expression!r}")
    ranks = [sorted(PREFERRED.index(licence) for licence in s) for s in known]
    return [PREFERRED[rank] for rank in min(ranks)]


def plain(text):
    """For comparing: no case, runs of white space or typographic quotes."""
    for curly, straight in ("“\"", "”\"", "‘'", "’'"):
        text = text.replace(curly, straight)
    return " ".join(text.lower().split())


def is_text_of(licence, text):
    text = plain(text)
    return all(plain(mark) in text for mark in MARKS[licence])


def read_texts(package):
    """Licence files and notices next to a crate's manifest: {file name: text}."""
    folder = Path(package["manifest_path"]).parent
    names = re.compile(r"(?i)(un)?licen[cs]e|copying|notice")
    files = sorted(f for f in folder.iterdir() if f.is_file() and names.match(f.name))
    if package["license_file"] and folder / package["license_file"] not in files:
        files.append(folder / package["license_file"])
    if package["name"] in CLARIFIED:
        files.append(folder / CLARIFIED[package["name"]][1])
    return {f.name: tidy(f.read_text(encoding="utf-8")) for f in files}


def tidy(text):
    lines = [line.rstrip() for line in text.lstrip("\ufeff").splitlines()]
    return "\n".join(lines).strip("\n") + "\n"


def repository(package):
    """Host, owner and name, without a path inside it; some crates give it as their homepage only."""
    address = package["repository"] or package["homepage"] or ""
    parts = re.match(r"https?://([^/]+/[^/]+/[^/#?]+)", address)
    return parts and parts[1].removesuffix(".git").lower()


def text_of(licence, texts):
    """The shortest of a crate's files that has the licence, preferably one with that licence alone."""
    return min((t for t in texts.values() if is_text_of(licence, t)), key=len, default=None)


def collect(packages):
    """Rows of (crate, its licences), and for each text the crates that it covers."""
    all_texts = [(p, read_texts(p)) for p in packages]
    rows, users = [], {}
    for package, texts in all_texts:
        name = f"{package['name']} {package['version']}"
        licences = choose(package)
        rows.append((name, " and ".join(licences)))
        for licence in licences:
            text = text_of(licence, texts)
            if text is None:
                home = repository(package)
                siblings = [t for p, t in all_texts if home and repository(p) == home]
                text = next(filter(None, (text_of(licence, t) for t in siblings)), None)
            if text is None:
                sys.exit(f"licenses.py: {name}: no text of {licence}, nor in another crate of its repository")
            users.setdefault((licence, text), []).append(name)
        for file, text in texts.items():
            if file.lower().startswith("notice"):
                users.setdefault(("Notice", text), []).append(name)
    return rows, users


def make(args):
    listed = json.loads(cargo("metadata", "--format-version=1", "--locked", "--all-features"))
    wanted = linked(args)
    # Path dependencies are part of this repository.
    packages = [p for p in listed["packages"] if p["source"] and (p["name"], p["version"]) in wanted]
    packages.sort(key=lambda p: (p["name"], p["version"]))
    rows, users = collect(packages)

    what = f"A binary with features {args.features}" if args.features else "A binary without optional features"
    out = [HEAD.format(what=what), "\n"]
    width = max(len(name) for name, _ in rows)
    out += [f"{name:{width}}  {licences}\n" for name, licences in rows]
    order = sorted(users.items(), key=lambda item: (PREFERRED + ["Notice"]).index(item[0][0]))
    for (licence, text), names in order:
        title = textwrap.fill(f"{licence}: {', '.join(names)}", len(RULE), break_on_hyphens=False)
        out.append(f"\n{RULE}\n{title}\n{RULE}\n\n{text}")
    return "".join(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--package", default="libvg", help="of the workspace; the C library if not given")
    parser.add_argument("--output", default=ROOT / "LICENSES-THIRD-PARTY", type=Path)
    parser.add_argument("--features", help="separated by commas")
    parser.add_argument("--target", action="append", help="may be repeated; default: Linux on x86-64 and ARM")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if the file is out of date")
    args = parser.parse_args()
    output = args.output

    text = make(args)
    if not args.check:
        output.write_text(text, encoding="utf-8")
        return 0
    old = output.read_text(encoding="utf-8") if output.exists() else ""
    if old == text:
        return 0
    changes = difflib.unified_diff(old.splitlines(), text.splitlines(), "committed", "now", n=0, lineterm="")
    print("\n".join(list(changes)[:40]))
    print(f"licenses.py: {output} is out of date: run scripts/licenses.py without --check", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
