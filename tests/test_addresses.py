"""No address that is shown lets anybody in."""

import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map
from shrm_cli.messages import has_secret, shown, shown_reason, shown_values, without_query

SECRET = "hUnTeR2%2Fx+y"


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("https://user:{}@host/a.exr", "https://***@host/a.exr"),
        ("https://{}@host:8080/a.exr", "https://***@host:8080/a.exr"),
        ("ftp://user:{}/z@host/a.exr", "ftp://***@host/a.exr"),
        ("https:/user:{}@host/a.exr", "https:/***@host/a.exr"),
        ("https://user:{}@host", "https://***@host"),
        ("https://u:p@q@{}@host/a@2x.exr", "https://***@host/a@2x.exr"),
        ("https://h/a.exr?X-Amz-Date=1&X-Amz-Signature={}", "https://h/a.exr?..."),
        ("https://h/a.exr?{}", "https://h/a.exr?..."),
        ("https://h/a.exr?a=1,2&b='{}", "https://h/a.exr?...'{}"),
        ("https://h/a.exr?sv=1;sig={}#top", "https://h/a.exr?..."),
        ("https://h/a.exr#access_token={}", "https://h/a.exr#..."),
        ("abfs://box/a.exr?sv=2020&sig={}", "abfs://box/a.exr?..."),
        ("s3+x://k:{}@b/p?.exr", "s3+x://***@b/p?.exr"),
        ("HTTPS://U:{}@H/A.EXR?X={}", "HTTPS://***@H/A.EXR?..."),
    ],
)
def test_secrets_of_urls_are_hidden(url, expected):
    url = url.replace("{}", SECRET)
    expected = expected.replace("{}", SECRET)
    if "'" in url:  # a quote ends a URL within a sentence
        expected = expected.removesuffix(SECRET)
        url = url.removesuffix(SECRET)
    assert shown(url) == expected
    assert shown(expected) == expected
    assert shown(f"Error: {url}: matches no file") == f"Error: {expected}: matches no file"
    assert shown(f"({url}), '{url}'.") == f"({expected}), '{expected}'."
    assert has_secret(url)
    assert not has_secret(expected)
    assert SECRET not in str(shown_values({"a": [url], url: (1, None, True, url)}))


@pytest.mark.parametrize(
    "text",
    [
        "s3://bucket/p?.exr", "s3://bucket/a@2x.exr", "https://host:8080/a@b.exr", "C:/a@b?c=d.exr",
        "probe.exr?x=1", "a:b@c.exr", "https://host/", "tcp://127.0.0.1:8786", "gs://b/**/[ab]*.exr",
        "0.5*ggx:roughness=0.3", "sftp://host:22/a@b", "https://h/a: what? no = sign", "",
    ],
)  # fmt: skip
def test_what_lets_nobody_in_stays_as_it_is(text):
    assert shown(text) == text
    assert shown_values([text]) == [text]


@pytest.mark.parametrize(
    "text",
    [
        "Cannot connect to host h ssl:default [user:{}@h]",
        "GET /box/a.exr?sv=2020&sig={}: 403",
        "url='https://h/a.exr?X-Amz-Signature={}', status=403",
        "{{'X-Amz-Security-Token': '{}'}}",
        "SignatureDoesNotMatch&Signature={}",
        "<urlopen error user:{}@h.example>",
        'the header "token": "{}" was refused',
    ],
)
def test_what_libraries_say_holds_no_secret(text):
    assert "hUnTeR2" not in shown_reason(text.replace("{}", SECRET))


def test_a_name_is_left_of_a_url():
    assert without_query("https://u:p@h/d/a.exr?sig=a/b.c#x") == "https://h/d/a.exr"
    assert without_query("https://u:p@h") == "https://h"
    assert without_query("s3://b/a?.exr") == "s3://b/a?.exr"
    assert without_query("dir/a.exr?x=1") == "dir/a.exr?x=1"


def test_hiding_takes_no_longer_than_the_text():
    """Each would take minutes if its time grew as the square of its length."""
    for text in ("a:/", "?", "x://@", "a:", "http://", "x://:", "://?=", "'sig", "a", "x://#", "]"):
        shown_reason(text * 30_000)
        shown_reason(f"http://{text * 30_000}@")


def test_a_map_that_is_no_file_is_named_without_its_secrets():
    with pytest.raises(MapError, match=r"^https://\*\*\*@host/a.exr\?\.\.\.: no such file"):
        open_map("https://me:hunter2@host/a.exr?sig=hunter2")
