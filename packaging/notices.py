#!/usr/bin/env python3
"""Third-party notices and bill of materials of the packages: all crates that the program, the Python extension and the C
library link, with the texts of their licences, as THIRD-PARTY-NOTICES.txt and svl.cdx.json (CycloneDX 1.5).

    packaging/notices.py OUT TRIPLE
"""

import html
import json
import os
import re
import subprocess
import sys
from pathlib import Path

PACKAGES = ["svl", "svl-python", "svl-c"]
LICENCE_FILE = re.compile(r"licen[cs]e|copying|copyright|notice|unlicense|authors", re.I)
LICENCE_FOLDER = re.compile(r"\.?licen[cs]es?$", re.I)
NO_TEXT = re.compile(r".*\.(rs|yml|toml|py)$", re.I)
# Words of the texts of licences.
WORDS = {
    "Apache-2.0": "Apache License",
    "BSD-2-Clause": "Redistribution and use",
    "BSD-3-Clause": "Redistribution and use",
    "BSL-1.0": "Boost Software License",
    "ISC": "Permission to use, copy, modify, and",
    "MIT": "Permission is hereby granted, free of charge",
    "MPL-2.0": "Mozilla Public License",
    "Unicode-3.0": "UNICODE LICENSE",
    "Zlib": "This software is provided",
}
# Folders of a crate that are not linked.
NOT_LINKED = {".github", "benches", "contrib", "examples", "programs", "samples", "tests"}
RULE = "=" * 80


def printed(*command):
    ran = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if ran.returncode:
        sys.exit(f"{' '.join(command[:3])} failed: see above; without network, run `cargo fetch --locked` with one first")
    return ran.stdout


def linked(triple):
    """The crates of others that are linked, as cargo's metadata describes them: what `cargo tree -e normal` lists."""
    named = [word for name in PACKAGES for word in ("-p", name)]
    tree = printed("cargo", "tree", "--locked", "-e", "normal", "--target", triple, "--prefix", "none", *named)
    keys = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    metadata = json.loads(printed("cargo", "metadata", "--locked", "--format-version", "1"))
    crates = {(crate["name"], f"v{crate['version']}"): crate for crate in metadata["packages"]}
    found = [crates[key] for key in sorted(keys)]
    root = crates[("svl", next(version for name, version in keys if name == "svl"))]
    return root, [crate for crate in found if crate["source"]]


def expression(crate):
    return re.sub(r"\s*/\s*", " OR ", crate["license"] or "")


def texts(crate):
    """The licence files of a crate, and of what it bundles; not those of licences that are not chosen."""
    folder = Path(crate["manifest_path"]).parent
    for path, folders, files in os.walk(folder):
        folders[:] = sorted(set(folders) - NOT_LINKED)
        for name in sorted(files):
            is_named = LICENCE_FILE.match(name) or LICENCE_FOLDER.match(Path(path).name)
            if is_named and not NO_TEXT.match(name):
                text = Path(path, name).read_text(encoding="utf-8", errors="replace").strip()
                if "GPL" in expression(crate) or "GNU GENERAL PUBLIC LICENSE" not in text:
                    yield text


def missing(crate, own, standard):
    """A text for each licence that applies, of which the crate has none: any of alternatives may be chosen."""
    for part in expression(crate).split(" AND "):
        names = sorted(re.findall(r"[\w.+-]+", part), key=lambda name: name not in ("MIT", "Apache-2.0"))
        words = [WORDS[name] for name in names if name in WORDS]
        if own and (not words or any(word.lower() in " ".join(text.split()).lower() for word in words for text in own)):
            continue
        licence = next((name for name in names if name in standard), None)
        if licence is None:
            sys.exit(f"{crate['name']}: no text of its licence, {part!r}: add a crate or a file that has one")
        yield licence, standard[licence].replace("<year> <copyright holders>", "the authors named in the list")


def standard_texts(rust, crates, found):
    """A text for each licence: Rust's copy, or that of a crate that has it alone."""
    standard = {path.stem: path.read_text(encoding="utf-8").strip() for path in (rust / "licenses").glob("*.txt")}
    for crate in crates:
        if " " not in expression(crate) and len(found[crate["id"]]) == 1:
            standard.setdefault(expression(crate), found[crate["id"]][0])
    return standard


def notices(root, crates, out):
    found = {crate["id"]: list(texts(crate)) for crate in crates}
    rust = Path(printed("rustc", "--print", "sysroot").strip(), "share/doc/rust")
    library = rust / "COPYRIGHT-library.html"
    if not library.exists():
        sys.exit(f"{library}: missing; the notices need the Rust of https://rustup.rs")
    standard = standard_texts(rust, crates, found)
    users, lines = {}, []
    for crate in crates:
        name, own = f"{crate['name']} {crate['version']}", found[crate["id"]]
        source = f"https://crates.io/crates/{crate['name']}/{crate['version']}"
        lines.append(f"{name}: {expression(crate)}; {source}")
        added = list(missing(crate, own, standard))
        if added:
            authors, names = ", ".join(crate["authors"]) or "its authors", " and ".join(name for name, _ in added)
            lines[-1] += f"; by {authors}; it comes without the text of {names}, which is below"
        for text in own + [text for _, text in added]:
            users.setdefault(" ".join(text.split()), (text, []))[1].append(name)
    page = html.unescape(re.sub(r"<[^>]*>", "", library.read_text(encoding="utf-8")))
    page = re.sub(r"\n\s*\n+", "\n\n", re.sub(r"[ \t]+", " ", page)).strip()
    parts = [
        f"Third-party notices of svl {root['version']}\n\n"
        f"{len(crates)} crates are linked into the program, the Python extension and the C library, with the standard "
        "library\nof Rust and, on Linux, libunwind of LLVM (Apache-2.0 WITH LLVM-exception). Sources are at the "
        "addresses. Below the\nlist are the texts.\n",
        "\n".join(lines) + "\n",
    ]
    parts += [f"{RULE}\n{', '.join(dict.fromkeys(names))}\n{RULE}\n{text}\n" for text, names in users.values()]
    parts.append(f"{RULE}\n{printed('rustc', '--version').strip()}: its standard library\n{RULE}\n{page}\n")
    (out / "THIRD-PARTY-NOTICES.txt").write_text("\n".join(parts), encoding="utf-8")


def component(crate, kind, checksums):
    name, version = crate["name"], crate["version"]
    purl = f"pkg:cargo/{name}@{version}"
    described = {"type": kind, "bom-ref": purl, "name": name, "version": version, "purl": purl}
    if expression(crate):
        described["licenses"] = [{"expression": expression(crate)}]
    if (name, version) in checksums:
        described["hashes"] = [{"alg": "SHA-256", "content": checksums[name, version]}]
    if crate["repository"]:
        described["externalReferences"] = [{"type": "vcs", "url": crate["repository"]}]
    return described


def bill(root, crates, out):
    lock = Path(root["manifest_path"]).with_name("Cargo.lock").read_text(encoding="utf-8")
    entry = r'name = "(.*)"\nversion = "(.*)"\nsource = .*\nchecksum = "(.*)"'
    checksums = {(name, version): checksum for name, version, checksum in re.findall(entry, lock)}
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component(root, "application", checksums)},
        "components": [component(crate, "library", checksums) for crate in crates],
    }
    (out / "svl.cdx.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: packaging/notices.py OUT TRIPLE")
    os.chdir(Path(__file__).resolve().parent.parent)
    out = Path(sys.argv[1])
    root, crates = linked(sys.argv[2])
    notices(root, crates, out)
    bill(root, crates, out)
    print(f"{out}: notices and bill of materials of {len(crates)} crates")


if __name__ == "__main__":
    main()
