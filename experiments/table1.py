"""Table I with one seed, in minutes: ``python -m experiments.table1``, which ``make table1`` calls.

The runs are those of ``python -m experiments.run experiment=table1``; what is finished is found
finished. Then the table, by the code of ``python -m experiments.report``.
"""

from __future__ import annotations

import signal
import sys

from rich.console import Console

from experiments import report, run
from experiments.records.files import results_dir

MINUTES = 4  # from nothing on two quiet cores


def main() -> int:
    """Carry out the runs and show their table; the exit status of the runs."""
    console = Console(width=report.WIDTH, highlight=False)
    console.print(f"Table I: about {MINUTES} min on two quiet cores")
    sys.argv[1:] = ["experiment=table1"]
    status: int | str | None = 0
    try:
        run.entry_point()
    except SystemExit as end:
        status = end.code
    if status == 128 + signal.SIGINT:
        return int(status)
    try:
        report.write(results_dir(), console, brief=True)
    except (OSError, ValueError) as error:  # a full disk, a damaged file
        console.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        return 1
    return int(status or 0)


if __name__ == "__main__":
    sys.exit(main())
