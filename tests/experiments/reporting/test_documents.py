"""Parts of README and docs that are made of studies and configs are those of the records."""

from omegaconf import OmegaConf

from experiments import reference
from experiments.records.configs import CONFIGS
from experiments.records.files import ROOT
from experiments.reporting import documents


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


def test_the_docs_name_every_scene_and_the_licence_and_authors_of_its_frames():
    text = (ROOT / "docs" / "sensor.md").read_text("utf-8")
    names = {path.stem for path in (CONFIGS / "scene").glob("*.yaml")} - {"recorded"}
    for name in names:
        assert f"(`scene={name}`)" in text
        scene = OmegaConf.load(CONFIGS / "scene" / f"{name}.yaml").get("scene") or {}
        source = scene.get("source") or {}
        if "repository" in source:
            at = f"[{source.repository}](https://github.com/{source.repository})"
            about = f"licence: {source.licence}. Cite: {source.cite}."
            assert f"{at} at {source.commit[:7]}, {about}" in text
