"""Compares the bits of small scenes with those that were frozen, or freezes new ones.

    python tests/freeze.py                         compare, and name every entry that differs
    python tests/freeze.py --write                 freeze all entries, and name those that differed
    python tests/freeze.py --write 'plan: *'       freeze only the entries with such names

Entries are named `bits: CASE / STAGE / QUANTITY`, and `plan: ...` for sizes and texts, which may change while
the bits stay. `--threads N` computes with so many. Bits change for a reason: commit it with them.

A result can have other bits on another processor or with other libraries, where the functions of
`frozen/machine.py` round differently. The test is then skipped: first freeze there with sources that you
trust.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from fnmatch import fnmatchcase
from pathlib import Path

from frozen import machine
from frozen.cases import CASES, Result, computed
from frozen.quantities import Value

KEPT = Path(__file__).parent / "frozen" / "bits.json"

# Every entry by its name.
Entries = dict[str, Value]


def entries(case: str, result: Result) -> Entries:
    """Everything that a case has given, by name."""
    return {
        f"{kind}: {case} / {part} / {quantity}": value
        for kind, found in (("bits", result.bits), ("plan", result.plan))
        for part, quantities in found.items()
        for quantity, value in quantities.items()
    }


def read() -> tuple[dict[str, str], dict[str, str], Entries]:
    """What was frozen: fingerprint of the machine, versions of the libraries, entries."""
    if not KEPT.exists():
        return {}, {}, {}
    file = json.loads(KEPT.read_text(encoding="utf-8"))
    kept = {
        f"{kind}: {case} / {part} / {quantity}": value
        for kind, cases in file["entries"].items()
        for case, parts in cases.items()
        for part, quantities in parts.items()
        for quantity, value in quantities.items()
    }
    return file["machine"], file["libraries"], kept


def write(kept: Entries) -> None:
    """Freeze these entries, one a line."""
    nested: dict[str, dict[str, dict[str, dict[str, Value]]]] = {}
    for name in sorted(kept):
        kind, case, part, quantity = _parts(name)
        nested.setdefault(kind, {}).setdefault(case, {}).setdefault(part, {})[quantity] = kept[name]
    file = {"machine": machine.fingerprint(), "libraries": machine.libraries(), "entries": nested}
    KEPT.write_text(json.dumps(file, indent=1) + "\n", encoding="utf-8")


def _parts(name: str) -> tuple[str, str, str, str]:
    """Kind, case, part and quantity of an entry."""
    kind, _, rest = name.partition(": ")
    case, part, quantity = rest.split(" / ", maxsplit=2)
    return kind, case, part, quantity


def of_case(kept: Entries, case: str) -> Entries:
    """The frozen entries of one case."""
    return {name: value for name, value in kept.items() if _parts(name)[1] == case}


def differences(kept: Entries, found: Entries) -> dict[str, str]:
    """Every entry that differs, with its value before and now."""
    return {
        name: f"{kept.get(name, 'absent')} before, {found.get(name, 'absent')} now"
        for name in sorted(kept.keys() | found.keys())
        if kept.get(name) != found.get(name)
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", nargs="*", metavar="NAME", help="names or patterns; none: all entries")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args(arguments)
    frozen_on, _, kept = read()
    if frozen_on != machine.fingerprint():
        print("functions round differently here than where the bits were frozen (frozen/machine.py)")
    found: Entries = {}
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            found |= entries(case, computed(case, options.threads, Path(folder)))
    changed = differences(kept, found)
    if options.write is not None:
        patterns = options.write or ["*"]
        changed = {
            name: difference
            for name, difference in changed.items()
            if any(fnmatchcase(name, p) for p in patterns)
        }
        for name in changed:
            kept.pop(name, None)
            if name in found:
                kept[name] = found[name]
        write(kept)
    for name, difference in changed.items():
        print(f"{name}: {difference}")
    print(f"{len(changed)} of {len(found)} entries {'written' if options.write is not None else 'differ'}")
    return 1 if changed and options.write is None else 0


if __name__ == "__main__":
    sys.exit(main())
