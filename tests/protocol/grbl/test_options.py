"""Build options: every letter and word of the documents has a meaning, others are shown as unknown."""

import pytest

from protocol.grbl.options import LETTERS, WORDS, letter, word

DOCUMENTED = "VNMCPZHTAD0SR+2*$#IEWL"


def test_every_letter_of_the_documents_and_no_other() -> None:
    assert set(LETTERS) == set(DOCUMENTED)
    assert letter("?") is None


@pytest.mark.parametrize(
    ("of", "meaning"),
    [
        ("ENUMS", "describes its own settings ($ES)"),
        ("PROBES=2", "2 probes"),
        ("PROBES=many", "several probes"),
        ("ATC=0", "automatic tool changer, not in use"),
        ("ATC=1", "automatic tool changer"),
        ("NEW", None),
    ],
)
def test_words_with_and_without_values(of: str, meaning: str | None) -> None:
    found = word(of)
    assert (None if found is None else found.meaning) == meaning


def test_meanings_are_said_once() -> None:
    meanings = [option.meaning for option in (*LETTERS.values(), *WORDS.values())]
    assert len(meanings) == len(set(meanings))
