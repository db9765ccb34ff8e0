import json
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from server.jsontext import dumps

anything = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def refuse(constant: str) -> Any:
    raise AssertionError(f"{constant} is not JSON")


@given(anything)
def test_everything_is_strict_json_in_ascii(value: Any) -> None:
    text = dumps(value)
    assert text.isascii()
    json.loads(text, parse_constant=refuse)


@given(
    st.recursive(
        st.floats(allow_nan=False, allow_infinity=False) | st.text(), lambda inner: st.lists(inner, max_size=4)
    )
)
def test_what_json_can_say_comes_back(value: Any) -> None:
    assert json.loads(dumps(value)) == value


def test_numbers_that_json_cannot_say_are_null_and_the_rest_stays() -> None:
    value = {"a": math.nan, "b": (math.inf, 1.5), "c": [{"d": -math.inf}], "e": True}
    assert dumps(value) == '{"a":null,"b":[null,1.5],"c":[{"d":null}],"e":true}'
