"""What holds of every page: one answer at the top, rules of accessible pages, no network."""

import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import lxml.html
import numpy as np
import pandas as pd

_MOST = 3e6  # [byte] of a page


def script(name: str) -> str:
    """What a probe runs on a page."""
    return (Path(__file__).with_name("probes") / f"{name}.js").read_text()


def check_page(path: Path, summary: dict[str, Any]) -> Any:
    """Refuse a page that breaks a rule; returns it."""
    assert path.stat().st_size < _MOST
    page = lxml.html.fromstring(path.read_bytes())
    # The answer, and below it what contradicts it.
    answer = page.xpath("//header//p[@class='headline' or @class='warning']")
    assert summary["answer"]["sentence"] in " ".join(text(part) for part in answer)
    run = summary["provenance"]["run"]
    assert run["title"] in page.xpath("string(//header/p[@class='kicker'])")
    assert page.get("lang") == "en"
    levels = [int(heading.tag[1]) for heading in page.xpath("//h1|//h2|//h3|//h4|//h5|//h6")]
    assert levels[:2] == [1, 2]
    assert levels.count(1) == 1
    assert max(np.diff(levels)) <= 1
    first = page.xpath("//body//*[self::a or self::button or @tabindex]")[0]
    assert page.get_element_by_id(first.get("href")[1:]).tag == "main"
    # What shows the answer is open, the rest is folded.
    assert [element.get("open") is not None for element in page.xpath("//section/details")].count(
        True
    ) == 1
    assert page.xpath("//section/details")[0].get("open") is not None
    ids = page.xpath("//@id")
    assert len(ids) == len(set(ids))
    assert set(page.xpath("//@aria-labelledby")) <= set(ids)
    for table in page.xpath("//table"):
        assert table.xpath("string(caption)").strip()
        assert all(cell.get("scope") == "col" for cell in table.xpath("thead//th"))
        width = len(table.xpath("thead/tr/th"))
        for row in table.xpath("tbody/tr"):
            assert row[0].get("scope") == "row"
            assert len(row) == width
    for drawing in page.xpath("//svg[not(ancestor::svg)]"):
        assert drawing.get("role") == "img"
        assert drawing.get("aria-label").strip()
    assert not page.xpath("//svg[ancestor::svg][not(@aria-hidden)]|//img[not(@alt)]")
    for link in map(unquote, page.xpath("//a/@href")):
        there = path.parent / link
        assert link[1:] in ids if link.startswith("#") else there.stat().st_size > 0, link
    addresses = page.xpath("//@href|//@src|//@srcset|//@action|//@data")
    assert not [a for a in addresses if ":" in a.split("/")[0] and not a.startswith("data:")]
    source = re.sub(r"data:,", "", path.read_text())
    assert not re.search(r"(?:src|href)=\"(?:\w+:)?//|url\(|@import", source)
    (policy,) = page.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")
    assert policy.startswith("default-src 'none'")
    assert not re.search(r"http|\*|self", policy)
    return page


def text(element: Any) -> str:
    return " ".join(element.text_content().split())


def section(page: Any, name: str) -> Any:
    return page.xpath(f"//section[@aria-labelledby='{name}']")[0]


def data(page: Any, table: str) -> pd.DataFrame:
    """Numbers of a table as the page sorts them, texts as they are shown, by its headings."""
    table = page.get_element_by_id(table)
    titles = [text(cell) for cell in table.xpath("thead/tr/th")][1:]
    rows = {
        text(row[0]): [
            float(value) if (value := cell.get("data-value")) else text(cell) for cell in row[1:]
        ]
        for row in table.find("tbody")
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=titles)
