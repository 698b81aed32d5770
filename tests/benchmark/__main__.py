"""Every route of the classifier beside its peers: ``python -m tests.benchmark``.

Writes a row per route and size into a CSV and prints the goals. It exits with 1 where a route gave
another result than the reference; a goal that is missed is printed and no error, since times belong
to the machine.
"""

import argparse
import importlib.metadata
import sys
from pathlib import Path

import pandas as pd
import torch

from experiments.records.environment import cpu_model
from tests.benchmark.cases import Case
from tests.benchmark.measure import goals, measure, sizes

PACKAGES = ("torch", "numpy", "numba")


def main():
    """Measure everything; 1 if a result was wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmark", description=__doc__
    )
    parser.add_argument("--device", default="cpu", help="cuda adds routes on a GPU")
    parser.add_argument("--out", type=Path, default=Path("results/mine/benchmark.csv"))
    chosen = parser.parse_args()
    rows = []
    for size in sizes():
        rows += measure(Case(**size, device=chosen.device))
        print(
            f"{size['operation']}, {size['n']} × {size['d']} pixels, {size['l']} classes"
        )
    device = chosen.device
    if device.startswith("cuda"):
        device = f"{device}: {torch.cuda.get_device_name(device)}"
    versions = {package: importlib.metadata.version(package) for package in PACKAGES}
    about = {"device": device, "cpu": cpu_model(), "threads": torch.get_num_threads()}
    found = pd.DataFrame(rows).assign(**about, **versions)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    found.to_csv(chosen.out, index=False, float_format="%.6g")
    print(goals(found).to_string(index=False))
    print(f"{len(found)} rows: {chosen.out}")
    wrong = found[found.status == "wrong result"]
    for row in wrong.itertuples():
        print(f"error: {row.operation} by {row.route}: wrong result", file=sys.stderr)
    return int(len(wrong) > 0)


if __name__ == "__main__":
    sys.exit(main())
