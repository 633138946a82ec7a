"""One browser for all tests of pages: its start costs more than a page."""

import pytest

from tests.reporting.browser import Browser


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    made = Browser(tmp_path_factory.mktemp("browser"))
    yield made
    made.close()
