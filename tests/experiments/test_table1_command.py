"""``make table1``: one line of progress, one table, once, and what lies outside the reference."""

import io
import re

import pytest
from rich.console import Console

from experiments import report, table1
from experiments.records.results import Results
from experiments.reporting import terminal
from experiments.studies.table1.view import STUDY


def epochs(*pairs):
    """A curve of (seconds, training accuracy, test accuracy)."""
    return [
        {"training_s": s, "loss": 1.0, "train_accuracy": a, "test_accuracy": b}
        for s, a, b in pairs
    ]


def a_first_look(write_run):
    """One seed: softmax reaches 90 % after 7.5 times the time of HDC, three layers stop there."""
    write_run("hdc", curve=[{"training_s": 0.035}])
    write_run("softmax", curve=epochs((0.2625, 0.95, 0.9), (2.8, 1.0, 1.0)))
    write_run("cnn1", curve=epochs((8.9, 0.95, 0.84), (21.9, 1.0, 1.0)))
    write_run("cnn3", curve=epochs((94.0, 0.98, 0.99)), stop="quick")


@pytest.fixture
def first_look(tmp_path, write_run):
    """The table of a first look, whose three layers were not trained on."""
    a_first_look(write_run)
    path = tmp_path / "records.jsonl"
    lines = path.read_text().splitlines()
    lines[-1] = lines[-1].replace('"stop":"trained"', '"stop":"reached"')
    path.write_text("\n".join(lines) + "\n")
    return next(t for t in STUDY.tables_of(Results(tmp_path)) if t.name == "table1")


def shown(show):
    console = Console(file=io.StringIO(), width=100)
    show(console)
    return console.file.getvalue().splitlines()


def test_the_table_on_the_terminal_has_the_cells_of_its_file(first_look):
    title, models, *lines = shown(
        lambda console: terminal.show_table1(console, first_look)
    )
    assert title == first_look.title
    names, *others = zip(*first_look.cells(), strict=True)
    assert re.split(r"  +", models.strip()) == ["Model", *names]
    words = " ".join(" ".join(lines).split())
    for head in first_look.heads[1:]:
        assert set(head.split()) <= set(words.split())
    values = [cell.split(" [")[0] for cells in others for cell in cells]
    assert not [value for value in values if value not in words]


def test_the_last_line_says_what_one_seed_is_worth(first_look, tmp_path, write_run):
    text = "One seed decides nothing: make reproduce QUICK=1 · page: a.html"
    assert terminal.last_line(first_look, "a.html") == text
    write_run("hdc", seed=1)
    (more,) = (t for t in STUDY.tables_of(Results(tmp_path)) if t.name == "table1")
    assert terminal.last_line(more, "a.html") == "page: a.html"
    assert terminal.last_line(None, "a.html") == "page: a.html"


def test_a_brief_report_shows_the_table_once_and_no_reference(
    tmp_path, write_run, monkeypatch
):
    a_first_look(write_run)
    monkeypatch.setattr(report, "studies_of", lambda _: [STUDY])
    lines = shown(lambda console: report.write(tmp_path, console, brief=True))
    assert [line.startswith("Table I,") for line in lines].count(True) == 1
    assert lines[0].startswith("Table I,")
    assert lines[-1].startswith("One seed decides nothing")
    (differs,) = (line for line in lines if line.startswith("Softmax took"))
    assert re.fullmatch(
        r"Softmax took 7\.5 times HDC's training time \(reference: \S+ to \S+\); one seed on a "
        r"busy machine often differs that much\.",
        differs,
    )
    assert not [
        line for line in lines if re.match("mine|reference|[0-9]+ number", line)
    ]


@pytest.mark.parametrize("status", [0, 1, 75])
def test_the_command_carries_out_the_experiment_and_then_shows_its_table(
    results, monkeypatch, status
):
    """Whether the runs went well or not: the table says what is missing."""
    called, reported = [], []

    def carry_out():
        called.append(table1.sys.argv[1:])
        table1.sys.exit(status)

    monkeypatch.setattr(table1.run, "entry_point", carry_out)
    monkeypatch.setattr(report, "write", lambda *_, **more: reported.append(more))
    monkeypatch.setattr(table1.sys, "argv", ["table1"])
    assert table1.main() == status
    assert called == [["experiment=table1"]]
    assert reported == [{"brief": True}]


def test_an_interrupted_command_shows_no_table(results, monkeypatch):
    monkeypatch.setattr(table1.run, "entry_point", lambda: table1.sys.exit(130))
    monkeypatch.setattr(report, "write", lambda *_, **__: pytest.fail("shown"))
    monkeypatch.setattr(table1.sys, "argv", ["table1"])
    assert table1.main() == 130


def test_a_table_that_cannot_be_written_is_one_line(results, monkeypatch, capsys):
    def full(*_, **__):
        raise OSError(28, "No space left on device", "report.html")

    monkeypatch.setattr(table1.run, "entry_point", lambda: table1.sys.exit(0))
    monkeypatch.setattr(report, "write", full)
    monkeypatch.setattr(table1.sys, "argv", ["table1"])
    assert table1.main() == 1
    assert capsys.readouterr().out.splitlines()[-1] == (
        "error: [Errno 28] No space left on device: 'report.html'"
    )
