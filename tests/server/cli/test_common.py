"""Text that is shown cannot steer a terminal."""

from hypothesis import given
from hypothesis import strategies as st

from server.cli.common import BrokenOffError, CliError, ExitCode, safe


@given(st.text())
def test_safe_text_is_one_printable_line(text: str) -> None:
    assert safe(text).isprintable()


@given(st.text(st.characters(categories=["L", "N"])))
def test_letters_of_any_script_stay(text: str) -> None:
    assert safe(text) == text


def test_what_a_terminal_would_obey_is_written_out() -> None:
    assert safe("\x1b[2Jrm\r\n\u202e") == "\\x1b[2Jrm\\r\\n\\u202e"


def test_exit_codes_are_those_of_the_contract() -> None:
    assert [code.value for code in ExitCode] == [0, 1, 2, 3, 130]


def test_an_error_has_a_problem_for_scripts() -> None:
    assert CliError(ExitCode.FAILED, "no").problem == {"code": "failed", "detail": "no"}
    assert BrokenOffError("goes on").problem == {"code": "broken_off", "detail": "goes on"}
