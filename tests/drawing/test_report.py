"""The page of a retargeting holds all there is to see, and needs nothing else."""

from __future__ import annotations

import html.parser
from pathlib import Path

import pytest
from drawing.browser import chromium, opened, playwright_or_skip
from small_retargeting import small_retargeting

import geodesic_ocp as go

EVIL = '<script>alert("1")</script>'

pytestmark = pytest.mark.slow


class Elements(html.parser.HTMLParser):
    """What elements there are, what they refer to, and the text outside scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.addresses += [
            str(value) for name, value in attrs if name in ("src", "href", "data", "action")
        ]

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1] not in ("script", "style"):
            self.text += data


def elements(text: str) -> Elements:
    found = Elements()
    found.feed(text)
    return found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("report") / "report.html"
    assert go.drawing.report(small_retargeting(), file) == file
    return file


def test_the_page_needs_nothing_else(page: Path) -> None:
    found = elements(page.read_text(encoding="utf-8"))
    assert all(address.startswith("data:") for address in found.addresses)
    assert found.tags.count("table") == 2
    assert "link" not in found.tags
    assert "Human left arm (mirrored) on robot" in found.text


@pytest.mark.slow
def test_tables_are_those_of_the_result(page: Path) -> None:
    text = elements(page.read_text(encoding="utf-8")).text
    retargeting = small_retargeting()
    for table in (retargeting.table(), retargeting.synergy_table()):
        assert all(str(name) in text for name in table.columns)
        assert f"{table.iloc[0, -3]:#.3g}" in text


@pytest.mark.slow
def test_the_time_is_told_and_the_page_opens_in_a_browser(page: Path, tmp_path: Path) -> None:
    """Both panes are drawn, and nothing is logged."""
    assert "the person's time" in elements(page.read_text(encoding="utf-8")).text
    slow = small_retargeting(0.8, EVIL)
    file = go.drawing.report(slow, tmp_path / "slow.html")
    text = elements(file.read_text(encoding="utf-8")).text
    assert f"{slow.stretch:.2f} times as long as the person" in text
    with (
        playwright_or_skip() as driver,
        chromium(driver) as browser,
        opened(browser, file) as opened_page,
    ):
        opened_page.locator("canvas").first.wait_for()
        assert opened_page.locator("canvas").count() == 2
        assert EVIL in opened_page.locator("body").inner_text()
