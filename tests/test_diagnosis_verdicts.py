"""The page of `diagnose` after a search that was interrupted, and one without a measured force."""

import json
import signal
from pathlib import Path
from typing import Any

import lxml.html
import pandas as pd
import pytest

from .diagnosis_pages import EFFECTS, STOPS, TWINS, diagnose, section, text
from .processes import running


@pytest.fixture(scope="session")
def forceless(root, stops, tmp_path_factory) -> Any:
    """The page of the same stops without Fx, in which nothing is wrong then."""
    folder = tmp_path_factory.mktemp("forceless")
    for name in STOPS:
        (folder / name).mkdir()
        (folder / name / "case.toml").write_text((stops / name / "case.toml").read_text())
        table = pd.read_csv(stops / name / "measured.csv")
        forces = [column for column in table if column.startswith("Fx")]
        table.drop(columns=forces).to_csv(folder / name / "measured.csv", index=False)
    out = diagnose(root, folder, tmp_path_factory.mktemp("forceless_out"))
    return lxml.html.fromstring((out / "index.html").read_bytes())


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.long
def test_an_interrupted_search_keeps_what_it_found(root, stops, tmp_path):
    """Ctrl-C while a second cause is sought."""
    arguments = ["diagnose", str(stops), "--effects", *EFFECTS, "--out", str(tmp_path)]
    searches = 0
    with running("-m", "workbench", *arguments) as run:
        for line in run.stderr:
            searches += "signatures" in line
            if searches == 2 and "signatures" in line:
                run.send_signal(signal.SIGINT)
    assert run.returncode == 130
    summary = json.loads((tmp_path / "summary.json").read_text())
    (cause,) = summary["causes"]
    assert cause["effect"] in TWINS
    assert summary["gain"]["after"] < summary["gain"]["before"]
    assert Path(summary["model"]["fmu"]).is_file()
    page = lxml.html.fromstring((tmp_path / "index.html").read_bytes())
    assert "interrupted" in text(page.find_class("warning")[0])
    assert "more may be missing" in text(page.get_element_by_id("answer"))


def test_without_force_the_verdict_says_what_that_costs(forceless):
    headline = text(forceless.find_class("headline")[0])
    assert headline.startswith("Nothing.")
    assert "Without a measured creep force, fewer effects" in headline
    assert any(
        "Creep force Fx was not measured" in text(one) for one in forceless.find_class("warning")
    )
    titles = [text(title) for title in forceless.xpath("//article//text[@class='title']")]
    assert not [title for title in titles if "force" in title or "balance" in title]
    # What it was is estimated nevertheless.
    estimated = section(forceless, "estimate").xpath(".//text[@class='title']")
    assert any(text(title).startswith("Creep force") for title in estimated)


def test_where_nothing_is_missing_nothing_is_claimed(forceless):
    assert not forceless.find_class("dots")
    assert not forceless.xpath("//section[@aria-labelledby='model']")
    assert not forceless.xpath("//a[@href='#model']")
    assert "Nothing was extended" in text(section(forceless, "gain"))
    assert not forceless.xpath("//path[contains(@class, 'style-2')]")
    assert text(section(forceless, "causes")).startswith("Causes, strongest first None.")
