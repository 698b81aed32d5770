"""Test the tests: change the code in small ways, and count the changes that a test notices.

    python -m tests.mutants

A seed chooses the changes, so that everyone tests the same ones of a commit: 150 of the library,
and 150 of the protocol, the records, the estimates and the claims. What survives is printed; see a
change with ``mutmut show NAME``.
"""

import json
import random
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

SEED = 2024
SIZE = 150
PARTS = {
    "library": re.compile(r"hdc\.((encoders|readouts)\.)?\w+\.[^.]+"),
    "harness": re.compile(r"experiments\..*"),
}
"""Which names are of a part: those of the library without readers, commands and kernels."""
FIRST = "hdc.encoders.base.*"
"""A small module: its run makes all mutants, and finds which tests reach them."""
NOTICED = {
    **dict.fromkeys((1, 3), "noticed"),
    **dict.fromkeys((-24, 24, 36, 152, 255), "too slow"),
    0: "survived",
    **dict.fromkeys((5, 33), "no test"),
}
"""What an exit status of the tests means."""


def results() -> dict[str, int | None]:
    """Exit status of the tests by name of the mutant, None where it did not run."""
    found = {}
    for path in sorted(Path("mutants").rglob("*.meta")):
        found |= json.loads(path.read_text())["exit_code_by_key"]
    return found


def run(*names: str) -> None:
    """Run the tests for mutants of these names or patterns."""
    program = Path(sys.executable).with_name("mutmut")
    subprocess.run([program, "run", "--max-children", "2", *names], check=True)


def main() -> None:
    run(FIRST)
    names = sorted(results())
    draw = random.Random(SEED)
    chosen = {
        part: draw.sample([name for name in names if of.fullmatch(name)], SIZE)
        for part, of in PARTS.items()
    }
    run(*(name for part in chosen.values() for name in part))
    found = results()
    for part, sample in chosen.items():
        counts = Counter(NOTICED.get(found[name], "not run") for name in sample)
        tested = counts["noticed"] + counts["too slow"] + counts["survived"]
        share = (tested - counts["survived"]) / tested
        print(
            f"{part}: {dict(counts)}; {100 * share:.1f} % of those that a test reaches"
        )
        for name in sample:
            if found[name] not in (1, 3):
                print(f"  {NOTICED.get(found[name], 'not run')}: {name}")


if __name__ == "__main__":
    main()
