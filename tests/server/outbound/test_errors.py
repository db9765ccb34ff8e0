"""What cannot be opened is told with its key and what to do; a secret is the first line of its file."""

from pathlib import Path

import pytest

from server.outbound.errors import OutboundError, first_line, need


def test_an_extra_that_is_missing_names_the_command() -> None:
    need("mqtt", "json")
    with pytest.raises(OutboundError, match=r"mqtt\.enabled: no_such_thing, .*pip install 'millstream\[mqtt\]'"):
        need("mqtt", "no_such_thing")


def test_the_first_line_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "secret"
    file.write_bytes("пароль \r\nmore\n".encode())
    assert first_line("k", file) == "пароль"
    assert first_line("k", None) is None


@pytest.mark.parametrize(
    ("content", "reason"),
    [(None, "No such file"), (b"", "the first line is empty"), (b"\nx", "is empty"), (b"\xff", "not UTF-8")],
)
def test_a_file_without_a_secret(content: bytes | None, reason: str, tmp_path: Path) -> None:
    file = tmp_path / "secret"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(OutboundError, match=f"^mqtt.password_file: .*{reason}"):
        first_line("mqtt.password_file", file)
