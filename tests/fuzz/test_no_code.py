"""No file that is read can bring code with it: nothing is unpickled or evaluated anywhere."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from experiments.records.sources import PACKAGES, ROOT

FORBIDDEN_IMPORTS = {"pickle", "dill", "cloudpickle", "shelve", "marshal", "joblib"}
FORBIDDEN_CALLS = {"eval", "exec", "torch.load", "yaml.load", "yaml.unsafe_load", "pd.read_pickle"}
FILES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def faults(text: str) -> list[str]:
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            module = node.module if isinstance(node, ast.ImportFrom) else None
            names = [module or "", *(alias.name for alias in node.names)]
            found += [name for name in names if name.partition(".")[0] in FORBIDDEN_IMPORTS]
        elif isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            given = {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords}
            reads = name in ("np.load", "numpy.load") or name.endswith("format.read_array")
            if name in FORBIDDEN_CALLS or (reads and given.get("allow_pickle") != "False"):
                found.append(name)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_file_is_unpickled_or_evaluated(path: Path):
    assert faults(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "text",
    [
        "import pickle", "from joblib import load", "eval(x)", "torch.load(p)", "np.load(p)",
        "np.load(p, allow_pickle=True)", "np.lib.format.read_array(f)",
    ],
)  # fmt: skip
def test_the_faults_are_found(text):
    assert faults(text)
