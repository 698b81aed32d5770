"""Parts of README and docs that are made of studies, records and configs, as Markdown.

A page has them between ``<!-- begin NAME -->`` and ``<!-- end NAME -->``; ``python -m
experiments.reference`` fills them again, so that no page says what the records do not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.records import configs
from experiments.records.results import Results, of_scenes
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table
from experiments.reporting.text import CAPTURED, COMPUTED, SIMULATED, markdown_text
from scenes.fibre import PRESSED
from scenes.source import Source

_BLOCK = re.compile(r"(<!-- begin (\w+) -->\n).*?(<!-- end \2 -->)", re.DOTALL)
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


def gallery(
    studies: Sequence[Study],
    tables: Mapping[str, Sequence[Table]],
    plots: Mapping[str, Sequence[Plot]],
) -> str:
    """Every figure with its caption, the tables of its study, and the command that makes it again.

    Args:
        studies: in the order of the page.
        tables, plots: those of each study, by its name.
    """
    parts = []
    for study in studies:
        if not plots.get(study.name):
            continue
        parts.append(f"## {study.title}\n\n{study.question}")
        parts += [_figure(plot) for plot in plots[study.name]]
        links = [
            f"[{markdown_text(table.title)}]({_RESULTS}/tables/{table.name}.csv)"
            for table in tables.get(study.name, ())
        ]
        parts.append("Tables: " + "; ".join(links) + "." if links else "")
    return "\n\n".join(filter(None, parts))


def _figure(plot: Plot) -> str:
    commands = "\n".join(f"    {command}" for command in plot.commands)
    file = f"{_RESULTS}/figures/{plot.name}.{plot.kind}"
    caption = markdown_text(plot.caption)
    return f"![{caption}]({file})\n\n{caption}\n\n{commands}".rstrip()


def scene_list(results: Results) -> str:
    """Every scene, by the kind of its frames, and what is known of it.

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
        parts.append(f"## {heading}")
        for name, config in _scenes_of(kind):
            parts.append(_scene(name, config, counts.get(name, "")))
    return "\n\n".join(parts)


def _scenes_of(kind: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and configs of the scenes of a kind, in the order of figures."""
    found = []
    for path in sorted((configs.CONFIGS / "scene").glob("*.yaml")):
        shown = configs.scene_display(path.stem)
        if shown["kind"] == kind and path.stem != "recorded":
            found.append((shown["place"], path.stem))
    for _, name in sorted(found):
        yield name, (configs.part("scene", name) or {}).get("scene", {})


def _counts(results: Results) -> dict[str, str]:
    """Frames, classes and split of each scene, as far as its records have them."""
    found = {}
    for run in results.runs:
        scene = run.record.scene
        height, width = scene.shape
        found[run.scene] = (
            f"{scene.n:,} frames of {height} × {width} pixels; {len(scene.classes)} classes."
        )
    frame = results.frame("recordings")
    for name, every in of_scenes(frame, "recordings").items():
        rows = every[every.split == "counts"]
        if not len(rows) or "n_classes" not in rows:
            continue
        most = max(n for sizes in rows.n for n in sizes)
        least_test, most_test = rows.n_test.min(), rows.n_test.max()
        tested = str(most_test)
        if least_test < most_test:
            tested = f"{least_test} to {most_test}"
        whole = found.get(name) or f"{rows.n_classes.iloc[0]:.0f} classes."
        found[name] = (
            f"{whole} Judged after at most {most} training frames a class, on {tested} test frames "
            f"a draw; {_split_of(rows.config.iloc[0]['splits']['counts'])}."
        )
    return found


_SPLITS = {
    "ordered": "the last {share} of each class in time test",
    "grouped": "frames of equal {group} are all on one side, about {share} test",
    "session": "the first session trains, the last tests",
    "random": "{share} drawn at random test",
}


def _split_of(split: Mapping[str, Any]) -> str:
    """A split in words."""
    share = f"{100 * split['test_fraction']:g} %"
    return _SPLITS[split["kind"]].format(share=share, group=f"“{split['group']}”")


def _scene(name: str, config: Mapping[str, Any], counts: str) -> str:
    """A scene: what its file says of it, its numbers, where its frames are, under which licence,
    whom to cite."""
    shown = configs.scene_display(name)
    lines = [f"### {shown['name']}", f"`scene={name}`: {shown['frames']}."]
    path = configs.CONFIGS / "scene" / f"{name}.yaml"
    if said := _comment(path):
        lines.append(said)
    if counts:
        lines.append(counts)
    source = _source(config)
    if source is None and shown["kind"] == COMPUTED:
        source = PRESSED
    if source is not None:
        lines.append(
            f"Files: [{source.repository}](https://github.com/{source.repository}) at "
            f"{source.commit[:7]}; licence: {source.licence}. Cite: {source.cite}."
        )
    return "\n\n".join(lines)


def _source(config: Mapping[str, Any]) -> Source | None:
    """The repository of a scene, or of the first that it is made of."""
    if config.get("source"):
        return Source(**config["source"])
    parts = [config.get("scene"), *config.get("scenes", {}).values()]
    return next((found for part in parts if part and (found := _source(part))), None)


def _comment(path: Path) -> str:
    """The sentences at the head of a config."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        if "@package" not in line:
            lines.append(line.removeprefix("#").strip())
    return markdown_text(" ".join(lines))
