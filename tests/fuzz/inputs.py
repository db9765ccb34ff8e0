"""Inputs near the seeds: pieces of them cut, doubled, swapped and spoilt, and now and then any bytes.

Strategies of Hypothesis, so that what was found is made small. The one rule: half of an input still has the shape of a
seed, or a parser would refuse it at its first byte and nothing behind that would be tried.
"""

from hypothesis import strategies as st

MOST_BYTES = 2000
ODD = [
    b"",
    b"\x00",
    b"\xff",
    b"\r\n",
    b";",
    b",",
    b"<",
    b">",
    b"|",
    b"#",
    b"[",
    b"]",
    b"$",
    b"%",
    b"=",
    b"&",
    b'"',
    b"\\",
]
ODD += [
    b"-",
    b".",
    b"1e999",
    b"9" * 40,
    b"-0",
    b"nan",
    b"\xc3",
    "И".encode(),
    "\u2028".encode(),
    b"null",
    b"{}",
    b"[[" * 40,
]


@st.composite
def near(draw: st.DrawFn, seeds: list[bytes]) -> bytes:
    """A seed after a few strokes."""
    data = draw(st.sampled_from(seeds))[:MOST_BYTES]
    for _ in range(draw(st.integers(0, 4))):
        at, end = sorted((draw(st.integers(0, len(data))), draw(st.integers(0, len(data)))))
        match draw(st.integers(0, 4)):
            case 0:
                data = data[:at] + data[end:]
            case 1:
                data = data[:end] + data[at:end] + data[end:]
            case 2:
                other = draw(st.sampled_from(seeds))[:MOST_BYTES]
                data = data[:at] + other[at:] + data[end:]
            case 3:
                data = data[:at] + draw(st.sampled_from(ODD)) + data[at:]
            case _:
                data = data[:at] + draw(st.binary(max_size=8)) + data[min(len(data), at + 8) :]
    return data[: 2 * MOST_BYTES]


def inputs(seeds: list[bytes]) -> st.SearchStrategy[bytes]:
    """What a harness is tried with."""
    return st.one_of(near(seeds), near(seeds), st.binary(max_size=200))
