"""The witness: each cell of the tables as they were is a cell of the tables as they are."""

import io
import subprocess
from pathlib import Path

import pandas as pd
import pytest
import yaml

from experiments.records.files import REFERENCE, ROOT

MAP = yaml.safe_load((Path(__file__).parent / "witness" / "map.yaml").read_text())
TABLES = "results/reference/tables"


def git(*words):
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else ""


OLD = sorted(
    Path(line).stem
    for line in git("ls-tree", "--name-only", MAP["commit"], f"{TABLES}/").split()
    if line.endswith(".csv")
)


def cells(text):
    return pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)


def as_it_became(name, old):
    """The old table with the rows, columns and terms of today."""
    models = MAP["models_left"]
    for column, text in MAP["rows_left"].get(name, {}).items():
        old = old[old[column] != text]
    for column in {"model", "rival"} & set(old.columns):
        old = old[~old[column].isin(models)]
    ends = ("", "_low", "_high")
    of_models = [f"{model}{end}" for model in models for end in ends]
    renamed = MAP["columns"].get(name, {})
    left = [column for column, new in renamed.items() if new is None]
    kept = {column: new for column, new in renamed.items() if new is not None}
    old = old.drop(columns=left).drop(columns=of_models, errors="ignore")
    if "record" in old:
        old = old.assign(record=old.record.map(as_records_became))
    old = old.rename(columns=kept).replace(MAP["terms"])
    for before, now in MAP["words"].items():
        old = old.map(lambda cell, words=(before, now): cell.replace(*words))
    return old


def as_records_became(names):
    """Where several records lay, by their ids, sorted."""
    return "; ".join(sorted(MAP["records"].get(n, n) for n in names.split("; ")))


@pytest.mark.skipif(not OLD, reason="this clone has not the commit of the witness")
@pytest.mark.parametrize("name", OLD)
def test_every_cell_is_where_the_map_says(name):
    if name in (*MAP["left"], *MAP["reshaped"]):
        return
    became = MAP["became"].get(name, {"table": name})
    new = cells((REFERENCE / "tables" / f"{became['table']}.csv").read_text())
    for column, value in became.get("where", {}).items():
        new = new[new[column] == value]
    if "record" in new:
        new = new.assign(record=new.record.map(as_records_became))
    anew = MAP["rows_anew"].get(name, {})
    for column, values in anew.items():
        new = new[~new[column].isin(values)]
    if "model" in new.columns:
        new = new[~new["model"].isin(MAP["models_new"])]
    old = as_it_became(name, cells(git("show", f"{MAP['commit']}:{TABLES}/{name}.csv")))
    for column, values in anew.items():
        old = old[~old[column].isin(values)]
    assert set(old.columns) <= set(new.columns)
    assert sorted(old.itertuples(index=False, name=None)) == sorted(
        new[old.columns].itertuples(index=False, name=None)
    )


@pytest.mark.skipif(not OLD, reason="this clone has not the commit of the witness")
def test_the_map_names_tables_that_were_there():
    for part in ("left", "reshaped", "became", "columns"):
        assert set(MAP[part]) <= set(OLD)
