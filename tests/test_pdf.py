"""A page as a report on paper: number, date, versions, hashes, lines to sign."""

import json
import re
import shutil
from pathlib import Path

import lxml.html
import pytest

from workbench.__main__ import main
from workbench.pages.templates import number_of

CASE = "01_dry_80_1.5"


@pytest.fixture(scope="module")
def results(tmp_path_factory, root) -> Path:
    """One estimator on one recorded stop, printed."""
    if shutil.which("chromium") is None:
        pytest.skip("no chromium")
    out = tmp_path_factory.mktemp("printed")
    case = str(root / "cases" / CASE)
    assert main(["simulate", case, "--estimator", "ekf", "--pdf", "--out", str(out)]) == 0
    return out


def test_report_has_a_few_pages(results):
    printed = (results / "report.pdf").read_bytes()
    assert printed.startswith(b"%PDF-")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 4


def test_report_tells_number_version_and_data_and_has_lines_to_sign(results):
    summary = json.loads((results / "summary.json").read_text())
    run = summary["provenance"]["run"]
    page = lxml.html.fromstring((results / "index.html").read_bytes())
    (footer,) = page.xpath("//footer")
    text = " ".join(footer.text_content().split())
    assert text.startswith(f"Report {number_of(summary)} ")
    assert run["workbench"] in text
    assert run["data"][CASE] in text
    for line in ("Compiled", "Checked", "Approved"):
        assert f"{line}: name, date, signature" in text


def test_another_result_has_another_number(results):
    summary = json.loads((results / "summary.json").read_text())
    number = number_of(summary)
    assert number == number_of(json.loads(json.dumps(summary)))
    summary["cases"][CASE]["estimators"]["ekf"]["z"] *= 1.0 + 1e-15
    assert number_of(summary) != number


def test_without_a_browser_nothing_is_begun(tmp_path, root, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    out = tmp_path / "out"
    assert main(["simulate", str(root / "cases" / CASE), "--pdf", "--out", str(out)]) == 2
    assert "install chromium, or leave --pdf out" in capsys.readouterr().err
    assert not out.exists()
