"""bench/page.py in a tiny setting, here since it needs the browser: it runs to its end and measures what it says."""

import pytest
from playwright.sync_api import Browser

from bench import page
from tests.harness.browser import FIRST_BYTES
from tests.harness.process import Daemon

pytestmark = pytest.mark.real


def test_the_benchmark_of_the_page_measures_what_it_says(browser: Browser, mill: Daemon) -> None:
    visit = {figure.name: figure.value for figure in page.first_visit(browser, mill.url, 1)}
    assert 0 < visit["first paint"] <= visit["live: connected, everything drawn"]
    assert 50 < visit["bytes over the network"] < FIRST_BYTES / 1024
    assert visit["requests"] > 50
    heap = {figure.name: figure.value for figure in page.memory(browser, 20, ["machine"], rounds=2)}
    assert 1 < heap["machine: at the end"] < 20
    path = {figure.name: figure.value for figure in page.preview(browser, mill, 2000, turned_s=0.3)}
    assert 0 < path["first picture"] <= path["as fine as this device draws it"]
    assert path["a picture while it is turned"] > 0
