from datetime import timedelta

import pytest

from server.access.lifetime import lifetime


@pytest.mark.parametrize(
    ("text", "length"),
    [("90d", timedelta(days=90)), ("12H", timedelta(hours=12)), (" 5m ", timedelta(minutes=5)), ("2w", timedelta(14))],
)
def test_a_number_and_its_unit(text: str, length: timedelta) -> None:
    assert lifetime(text) == length


@pytest.mark.parametrize("text", ["", "90", "d", "0d", "-1d", "1.5d", "1y", "99999999999d", "3651d", "٣d", "1d 2h"])
def test_what_is_no_lifetime(text: str) -> None:
    with pytest.raises(ValueError, match="90d"):
        lifetime(text)
