"""Parts of README and docs that are made of studies, records and configs, as Markdown.

A page has them between ``<!-- begin NAME -->`` and ``<!-- end NAME -->``; ``python -m
experiments.reference`` fills them again, so that no page says what the records do not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from omegaconf import OmegaConf

from experiments.protocol.needs import sources_of
from experiments.records import configs
from experiments.records.results import Results, by_scene
from experiments.reporting.answers import Answers
from experiments.reporting.columns import Column, display_name
from experiments.reporting.forms import FORMS
from experiments.reporting.pareto import is_on_front
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.text import (
    CAPTURED,
    COMPUTED,
    SIMULATED,
    markdown_table,
    markdown_text,
    number,
    percent,
)
from scenes.fibre import PRESSED

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


def costs(table: Table | None) -> str:
    """Error on two data sets, and on the first of them training time, time per frame and size.

    Times are by NumPy or by the compiled kernels, whichever are less.

    Args:
        table: ``recording_costs``; None where it was not measured.
    """
    if table is None:
        return NOT_MEASURED
    first, second = (_of_most_frames(table.data, name) for name in COSTS)
    heads = [f"Error, {configs.scene_display(name)['name']} (%)" for name in COSTS]
    lines = [["Model", *heads, "Training (s)", "Frame (ms)", "To predict (kB)"]]
    for model in FORMS:
        if model not in first.index or model not in second.index:
            continue
        row = first.loc[model]
        errors = 100 * row.error, 100 * second.error[model]
        if np.isnan(errors).all():  # timed, and not asked
            continue
        numbers = (
            *errors,
            row.fit_best_s,
            1e3 * row.predict_frame_best_s,
            row.bytes / 1e3,
        )
        lines.append([display_name(model), *(number(x, 2) for x in numbers)])
    return markdown_table(*lines)


def _of_most_frames(table: pd.DataFrame, recording: str) -> pd.DataFrame:
    """The models of a recording after the most training frames, by their names."""
    rows = table[table.recording == recording]
    return rows[rows.n == rows.n.max()].set_index("model")


def forms(table: Table | None) -> str:
    """Error of each form and baseline on every data set after the most frames, the lowest in bold.

    Args:
        table: ``recording_costs``; None where it was not measured.
    """
    if table is None:
        return NOT_MEASURED
    known = set(table.data.dropna(subset="error").model)
    shown = [model for model in FORMS if model in known]
    lines = [["Data set", *map(display_name, shown)]]
    for name in table.data.recording.unique():
        errors = _of_most_frames(table.data, name).error.reindex(shown)
        texts = [number(100 * error, 2) for error in errors]
        lowest = texts[int(errors.argmin())]
        marked = [f"**{text}**" if text == lowest else text for text in texts]
        lines.append([configs.scene_display(name)["name"], *marked])
    return markdown_table(*lines)


def opening(table: Table | None) -> str:
    """How published HDC and LDA of its bits stand in error and training time, in three sentences.

    Args:
        table: ``recording_costs``; None where it was not measured.
    """
    if table is None:
        return NOT_MEASURED
    others, fastest, behind, on_front = [], 0, 0, 0
    names = list(table.data.recording.unique())
    for name in names:
        rows = _of_most_frames(table.data, name).dropna(subset="error")
        hdc = rows.loc["hdc"]
        others.append(len(rows) - 1)
        fastest += (rows.fit_best_s <= hdc.fit_best_s).sum() == 1
        behind += (rows.error < hdc.error).sum() > others[-1] / 2
        on_front += "hdc_lda" in rows.index[is_on_front(rows.fit_best_s, rows.error)]
    least, most = min(others), max(others)
    number = f"{least}" if least == most else f"{least} to {most}"
    return (
        f"After {table.data.n.max()} training frames per class, HDC as published trains faster "
        f"than each of {number} other models on {fastest} of {len(names)} "
        f"public data sets. On {behind} of them, most of these models err less. With linear "
        f"discriminant analysis (LDA) of the same bits, HDC is on the Pareto front of error "
        f"against training time on {on_front}."
    )


def table1(table: Table | None) -> str:
    """Table I in five rows: published models by our measurement and by the paper's.

    Args:
        table: ``table1``; None where it was not measured.
    """
    if table is None:
        return NOT_MEASURED
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
        known = filter(_can_run, dict.fromkeys(map(_bare, made)))
        parts.append("\n".join(f"    {command}" for command in known))
    return "\n\n".join(filter(None, parts))


def _bare(command: str) -> str:
    """A command of ``experiments.run`` without the settings of one step: its experiment alone."""
    words = command.split()
    if words[2:3] != ["experiments.run"]:
        return command
    return " ".join(
        [*words[:3], *(w for w in words[3:] if w.startswith("experiment="))]
    )


def _can_run(command: str) -> bool:
    """Whether its experiment still has a config; records of an older commit may name others."""
    experiment = command.partition("experiment=")[2]
    return not experiment or configs.is_known("experiment", experiment)


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


def scene_list(results: Results) -> str:
    """Every scene, by the kind of its frames and where they are from, and what is known of it.

    Args:
        results: records, which have numbers of frames and of classes.
    """
    counts = _counts(results)
    parts = []
    for kind, heading in (
        (CAPTURED, "Captured by a camera"),
        (COMPUTED, "Computed from measured matrices"),
        (SIMULATED, "Simulated"),
    ):
        parts.append(f"### {heading}")
        by_source: dict[str, list[str]] = {}
        for name, config in _scenes_of(kind):
            line = _scene(name, counts.get(name, ""))
            by_source.setdefault(_from(kind, config), []).append(line)
        for source, lines in by_source.items():
            parts += filter(None, (source, "\n".join(lines)))
    return "\n\n".join(parts)


def _scenes_of(kind: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and configs of the scenes of a kind, in the order of figures."""
    found = []
    for path in sorted((configs.CONFIGS / "scene").glob("*.yaml")):
        shown = configs.scene_display(path.stem)
        if shown["kind"] == kind and path.stem != "recorded":
            found.append((shown["order"], path.stem))
    for _, name in sorted(found):
        yield name, _config_of(name)


def _config_of(name: str) -> dict[str, Any]:
    """The scene that its file makes, as Hydra composes it; required values are ``???``."""
    from hydra import compose, initialize_config_dir

    with initialize_config_dir(str(configs.CONFIGS), version_base="1.3"):
        config = compose("config", overrides=[f"scene={name}"])
    found: Any = OmegaConf.to_container(config, resolve=True)
    return found["scene"]  # type: ignore[no-any-return]


def _counts(results: Results) -> dict[str, str]:
    """Frames, classes and split of each scene, as far as its records have them."""
    found = {}
    for run in results.runs:
        of, label = run.results, run.scene.label if run.scene else ""
        found[label] = (
            f"{of['n_samples']:,} frames of {of['height']} × {of['width']} pixels; "
            f"{of['n_classes']} classes."
        )
    for name, every in by_scene(results.frame("recordings")).items():
        rows = every[(every.split == "counts") & every.n_classes.notna()]
        if len(rows):
            first = rows.iloc[0]
            whole = found.get(name) or f"{first.n_classes:.0f} classes."
            found[name] = f"{whole} Test: {_split_of(first)}."
    return found


_SPLITS = {
    "ordered": "the last {share} of each class in time",
    "grouped": "{share} of the groups{by}",
    "session": "the last session",
    "leave_group_out": "one group of each class{by}, each in its turn",
    "random": "{share} at random",
}


def _split_of(line: pd.Series) -> str:
    """The split that counts, in words."""
    kind, group, fraction = (
        line.get(f"splits.counts.{key}") for key in ("kind", "group", "test_fraction")
    )
    share = f"{100 * fraction:g} %"
    by = "" if group == "group" else f" ({group})"
    return _SPLITS[kind].format(share=share, by=by)


def _scene(name: str, counts: str) -> str:
    """A scene: what its file says of it, and its numbers."""
    shown = configs.scene_display(name)
    path = configs.CONFIGS / "scene" / f"{name}.yaml"
    said = _comment(path) or f"{shown['frames']}."
    return f"- **{shown['name']}** (`scene={name}`): {said} {counts}".rstrip()


def _from(kind: str, config: Mapping[str, Any]) -> str:
    """Where the frames of a scene are, under which licence, whom to cite; empty if simulated."""
    source = next(iter(sources_of(config)), None)
    if source is None and kind == COMPUTED:
        source = PRESSED
    if source is None:
        return ""
    return (
        f"[{source.repository}](https://github.com/{source.repository}) at {source.commit[:7]}, "
        f"licence: {source.licence}. Cite: {source.cite}."
    )


def _comment(path: Path) -> str:
    """The sentences at the head of a config."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        if "@package" not in line:
            lines.append(line.removeprefix("#").strip())
    return markdown_text(" ".join(lines))
