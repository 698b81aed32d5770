"""Parts of README and docs that are made of studies, records and configs, as Markdown.

A page has them between ``<!-- begin NAME -->`` and ``<!-- end NAME -->``; ``python -m
experiments.reference`` fills them again, so that no page says what the records do not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pandas as pd

from experiments.records import configs
from experiments.reporting.answers import Answers
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.forms import FORMS
from experiments.reporting.pareto import is_on_front
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.text import (
    markdown_table,
    markdown_text,
    number,
    percent,
)

_BLOCK = re.compile(r"(<!-- begin (\w+) -->\n).*?(<!-- end \2 -->)", re.DOTALL)
NOT_MEASURED = "*not measured yet*"
# The data sets of the table of costs: a camera under an elastomer, laser speckle of a fibre.
COSTS = ("gelsight", "fibre_grouped")
# The models of the paper, and the schedule that its accuracy of softmax needs.
TABLE1_OF = ("hdc", "softmax", "softmax_descent", "cnn1", "cnn3")
TABLE1_SHOWN = (
    *("model", "seeds", "training_time_s", "training_time_over_hdc"),
    *("train_accuracy_at_target", "test_accuracy_at_target", "test_accuracy_final"),
    "published_test_accuracy",
)
_TABLE1_HEADS = {
    "train_accuracy_at_target": Column("Training accuracy there (%)", percent),
    "test_accuracy_final": Column(
        "Converged: test (%)", cell=lambda row: percent(row["test_accuracy_final"])
    ),
    "published_test_accuracy": Column(
        "Paper: relative time, test (%)",
        cell=lambda row: (
            f"×{row['published_training_time_over_hdc']:.0f}, "
            f"{percent(row['published_test_accuracy'])}"
        ),
    ),
}
# From docs/ to the committed results.
_RESULTS = "../results/reference"


def fill(text: str, contents: Mapping[str, Callable[[], str]]) -> str:
    """A page with every marked block made again; a block that nothing fills stays."""

    def filled(match: re.Match[str]) -> str:
        begin, name, end = match.groups()
        if name not in contents:
            return match[0]
        return f"{begin}{contents[name]()}\n{end}"

    return _BLOCK.sub(filled, text)


def costs(table: Table) -> str:
    """Error on two data sets, and on the first of them training time, time per frame and size.

    Times are by NumPy or by the compiled kernels, whichever are less.

    Args:
        table: ``recording_costs``.
    """
    first, second = (_of_most_frames(table.data, name) for name in COSTS)
    heads = [f"Error, {configs.scene_display(name)['name']} (%)" for name in COSTS]
    both = first.assign(second=second.error).reindex(FORMS)
    asked = both.dropna(how="all", subset=["error", "second"])  # not only timed
    shown = {
        heads[0]: 100 * asked.error,
        heads[1]: 100 * asked.second,
        "Training (s)": asked.fit_best_s,
        "Frame (ms)": 1e3 * asked.predict_frame_best_s,
        "To predict (kB)": asked.bytes / 1e3,
    }
    return _by_name("Model", pd.DataFrame(shown).map(_two_digits), display_name)


def forms(table: Table) -> str:
    """Error of each form and baseline on every data set after the most frames, the lowest in bold.

    Args:
        table: ``recording_costs``.
    """
    names = table.data.recording.unique()
    errors = pd.DataFrame({n: _of_most_frames(table.data, n).error for n in names})
    rows = []
    for _, row in errors.reindex(FORMS).dropna(how="all").T.iterrows():
        texts = (100 * row).map(_two_digits)
        lowest = texts == texts[row.idxmin()]
        rows.append(texts.mask(lowest, "**" + texts + "**"))
    shown = pd.DataFrame(rows).rename(columns=display_name)
    return _by_name("Data set", shown, scene_name)


def _of_most_frames(table: pd.DataFrame, recording: str) -> pd.DataFrame:
    """The models of a recording after the most training frames, by their names."""
    rows = table[table.recording == recording]
    return rows[rows.n == rows.n.max()].set_index("model")


def _two_digits(value: Any) -> str:
    return number(value, 2)


def _by_name(head: str, cells: pd.DataFrame, shown: Callable[[str], str]) -> str:
    """Texts in Markdown, with the name of each row first."""
    rows = ([shown(name), *texts] for name, *texts in cells.itertuples())
    return markdown_table([head, *cells.columns], *rows)


def opening(table: Table) -> str:
    """How published HDC and LDA of its bits stand in error and training time, in three sentences.

    Args:
        table: ``recording_costs``.
    """
    others, fastest, behind, on_front = [], 0, 0, 0
    data = table.data.dropna(subset="error")
    names = list(data.recording.unique())
    for name in names:
        rows = _of_most_frames(data, name)
        hdc = rows.loc["hdc"]
        others.append(len(rows) - 1)
        fastest += (rows.fit_best_s <= hdc.fit_best_s).sum() == 1
        behind += (rows.error < hdc.error).sum() > others[-1] / 2
        on_front += "hdc_lda" in rows.index[is_on_front(rows.fit_best_s, rows.error)]
    least, most = min(others), max(others)
    number = f"{least}" if least == most else f"{least} to {most}"
    return (
        f"After {data.n.max()} training frames per class, HDC as published trains faster "
        f"than each of {number} other models on {fastest} of {len(names)} "
        f"public data sets. On {behind} of them, most of these models err less. With linear "
        f"discriminant analysis (LDA) of the same bits, HDC is on the Pareto front of error "
        f"against training time on {on_front}."
    )


def table1(table: Table) -> str:
    """Table I in five rows: published models by our measurement and by the paper's.

    Args:
        table: ``table1``.
    """
    rows = table.data[table.data.model.isin(TABLE1_OF)]
    columns = {name: table.column(name) for name in TABLE1_SHOWN} | _TABLE1_HEADS
    return replace(table, data=rows, shown=TABLE1_SHOWN, columns=columns).rows()


def results_page(answers: Answers, found: Mapping[str, str]) -> str:
    """The result of each study, its figures with their captions, its tables, and the commands.

    Args:
        answers: of the studies.
        found: a sentence by the name of a study; its question stands where there is none.
    """
    parts = []
    for study in answers.studies:
        figures, tables = answers.figures(study), answers.tables(study)
        if not figures and not tables:
            continue
        parts.append(f"## {study.title}\n\n{found.get(study.name, study.question)}")
        parts += map(_figure, figures)
        links = [f"[{t.name}]({_RESULTS}/tables/{t.name}.csv)" for t in tables]
        parts.append(f"Tables: {', '.join(links)}." if links else "")
        shown = [*(figure.table for figure in figures), *tables]
        made = [command for table in shown for command in table.commands]
        parts.append("\n".join(f"    {command}" for command in dict.fromkeys(made)))
    return "\n\n".join(filter(None, parts))


def _figure(figure: Figure) -> str:
    caption, title = map(markdown_text, (figure.caption, str(figure.title)))
    file = f"{_RESULTS}/figures/{figure.name}.svg"
    return f"![{title or figure.name}]({file})\n\n{caption}"


def model_list() -> str:
    """Every model: its name on the command line, its name in tables, and what it is."""
    lines = [["`model=`", "In tables", "Model"]]
    for path in sorted((configs.CONFIGS / "model").glob("*.yaml")):
        comment = re.findall(r"^# (?!@)(.*)", path.read_text("utf-8"), re.MULTILINE)
        first, *_ = re.split(r"(?<=\.)\s", " ".join(comment))
        name = path.stem
        lines.append([f"`{name}`", display_name(name), markdown_text(first)])
    return markdown_table(*lines)
