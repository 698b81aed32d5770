"""Parts of README and docs that are made of studies and configs are those of the records."""

from experiments import reference
from experiments.records.files import ROOT
from experiments.reporting import documents


def test_marked_blocks_are_filled_and_all_else_stays():
    blocks = [f"<!-- begin {n} -->\nold {n}\n<!-- end {n} -->" for n in ("one", "two")]
    page = "a\n" + "\nb\n".join(blocks)
    made = documents.fill(page, {"one": lambda: "new\nlines"})
    assert made == page.replace("old one", "new\nlines")
    assert documents.fill(made, {"one": lambda: "new\nlines"}) == made


def test_readme_and_docs_say_what_the_committed_records_say(committed):
    """After a change: python -m experiments.reference --tables."""
    made = {name: part() for name, part in reference.parts(committed).items()}
    stands = dict.fromkeys(made, 0)
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        text = page.read_text("utf-8")
        for name, part in made.items():
            stands[name] += f"<!-- begin {name} -->" in text
            filled = documents.fill(text, {name: lambda part=part: part})
            assert filled == text, f"{page.name}: {name}"
    assert set(stands.values()) == {1}
