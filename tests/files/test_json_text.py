"""JSON of files: only what can be used and printed is read."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.files.json_text import parse_json


@pytest.mark.parametrize(
    "text",
    [
        "NaN", "-Infinity", "[1e999]", '{"a": -1e400}', "9" * 5000, '"\\ud800"', '{"\\udfff": 1}',
        "[" * 17 + "]" * 17, '{"a":' * 17 + "1" + "}" * 17, "[" * 100_000, "", "{", "[1,]", "nul",
        '"a" "b"', None, 1.0, b"1",
    ],
)  # fmt: skip
def test_what_is_refused(text):
    with pytest.raises(ValueError, match=r"."):
        parse_json(text)


@pytest.mark.parametrize(
    "text", ['"]]]]{{{{\\"[["', '{"a": [1, 2.5, null, true, "\\u00e9"]}', "[]"]
)
def test_what_is_read(text):
    assert parse_json(text) == json.loads(text)


def test_depth_is_that_of_brackets_outside_of_texts():
    assert parse_json('["[[[[[[["]', 1) == ["[[[[[[["]
    with pytest.raises(ValueError, match="deep"):
        parse_json("[[]]", 1)


@pytest.mark.slow
@given(st.text())
def test_any_text_is_read_or_refused(text):
    try:
        value = parse_json(text)
    except ValueError:
        return
    json.dumps(value, allow_nan=False, ensure_ascii=False).encode()
