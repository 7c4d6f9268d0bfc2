"""Manifests: what they say, and what is refused."""

import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.batch.entry import DEFAULT_OUTPUT
from shrm_cli.batch.manifest import is_manifest, read_manifest
from shrm_cli.errors import ProbeError

WHOLE = """
probes = ["probes/*.exr"]
brdfs = ["microfacet:sigma=0.2", "phong"]
to = ["shrm", "irradiance"]
output = "bake/{probe}.{brdf}.{to}.exr"
eps = 0.1
precision = "float"

[reading]
yaw = 30
fix_nonfinite = true

[irradiance]
window = "auto"

[[entry]]

[[entry]]
probes = ["night/*.exr"]
brdfs = ["lambertian"]
eps = 0.02
irradiance = { size = 8 }
reading = { clamp = 100.0 }
"""


def written(tmp_path, text):
    path = tmp_path / "bake.toml"
    path.write_text(text)
    return str(path)


def test_entries_begin_with_what_stands_before_them(tmp_path):
    first, second = read_manifest(written(tmp_path, WHOLE))
    assert first.probes == ("probes/*.exr",)
    assert first.brdfs == ("microfacet:sigma=0.2", "phong")
    assert first.arguments == {"eps": 0.1}
    assert first.own == {"irradiance": {"window": "auto"}}
    assert first.reading == {"yaw": 30, "fix_nonfinite": True}
    assert (first.precision, second.precision) == ("float", "float")
    assert second.probes == ("night/*.exr",)
    assert second.arguments == {"eps": 0.02}
    assert second.own == {"irradiance": {"window": "auto", "size": 8}}
    assert second.reading == {"yaw": 30, "fix_nonfinite": True, "clamp": 100.0}
    assert second.output == "bake/{probe}.{brdf}.{to}.exr"


def test_the_manifest_of_the_page_is_read(tmp_path):
    """Its later entries have forms that not all of what stands above them applies to."""
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    text = page.split("```toml\n")[1].split("```")[0]
    first, second, third = read_manifest(written(tmp_path, text))
    assert first.own == {"irradiance": {"form": "zh3"}}
    assert (second.own, second.arguments) == ({}, {"error": 0.05})
    assert (third.brdfs, third.arguments) == ((), {"format": "bc6h"})
    assert second.brdfs == first.brdfs
    assert third.engines == ("three", "bevy")


@pytest.mark.parametrize(
    ("above", "own", "arguments"),
    [
        ("eps = 0.1", "error = 0.05", {"error": 0.05}),
        ("eps = 0.1\norder_f = 3", "seen = 0.05", {"seen": 0.05}),
        ("error = 0.1\nseen = 0.1", "eps = 0.05", {"eps": 0.05}),
        ("error = 0.1", "order_f = 3", {"order_f": 3}),
        ("error = 0.1", "seen = 0.05", {"error": 0.1, "seen": 0.05}),
        ("eps = 0.1", "order_f = 3", {"eps": 0.1, "order_f": 3}),
        ("eps = 0.1", "[entry.shrm]\nerror = 0.05", {"error": 0.05}),
        ("error = 0.1", "[entry.shrm]\neps = 0.05", {"eps": 0.05}),
        ("[shrm]\neps = 0.1", "[entry.shrm]\nerror = 0.05", {"error": 0.05}),
        ("[shrm]\neps = 0.1", "error = 0.05", {"eps": 0.1}),
    ],
)
def test_an_error_takes_the_place_of_what_it_chooses(tmp_path, above, own, arguments):
    text = f"probes = ['a']\nto = 'shrm'\nbrdfs = ['phong']\n{above}\n[[entry]]\n{own}\n"
    (entry,) = read_manifest(written(tmp_path, text))
    (recipe,) = entry.recipes()
    assert recipe.arguments == arguments


@pytest.mark.parametrize(
    ("to", "option", "asked"),
    [("shrm", "eps = 0.1", "seen"), ("principal", "maps = 3", "error"),
     ("cabral", "order_p = 2", "error"), ("product", "order = 3", "error")],
)  # fmt: skip
def test_what_an_error_chooses_is_refused_beside_it(tmp_path, to, option, asked):
    """Each job failed for itself, after a dry run that counted it as to be made."""
    text = f"probes = ['a']\nbrdfs = ['phong']\nto = '{to}'\n{option}\n{asked} = 0.1\n"
    said = f"'{option.split()[0]}' does not apply with '{asked}', which chooses it"
    with pytest.raises(ProbeError, match=said):
        read_manifest(written(tmp_path, text))


@pytest.mark.parametrize("own", ["eps = 0.1", "brdfs = ['phong']", "[entry.shrm]", "for = 'bevy'"])
def test_what_an_entry_says_itself_applies_to_it(tmp_path, own):
    shared = "probes = ['a']\nto = ['shrm']\nbrdfs = ['phong']\neps = 0.1\n"
    text = f"{shared}[[entry]]\n[[entry]]\nto = 'she'\n"
    assert read_manifest(written(tmp_path, text))[1].arguments == {}
    with pytest.raises(ProbeError, match=r"'(eps|brdf|to|for)'"):
        read_manifest(written(tmp_path, text + own))


def test_what_stands_before_all_entries_applies_to_one(tmp_path):
    text = "probes = ['a']\nto = 'she'\neps = 0.1\n[[entry]]\n[[entry]]\nto = 'irradiance'\n"
    with pytest.raises(ProbeError, match="'eps' applies with"):
        read_manifest(written(tmp_path, text))


def test_a_manifest_without_entries_is_one(tmp_path):
    (only,) = read_manifest(written(tmp_path, 'probes = "a.exr"\nto = "irradiance"\n'))
    assert (only.probes, only.to, only.output) == (("a.exr",), ("irradiance",), DEFAULT_OUTPUT)
    assert not only.runs_code  # a manifest may come from anywhere


def test_light_files_are_toml_too(tmp_path):
    assert is_manifest(written(tmp_path, WHOLE))
    assert not is_manifest(written(tmp_path, '[[probe]]\nfile = "a.exr"\n'))
    assert not is_manifest(written(tmp_path, "[[disc]]\nradius = 1\n"))
    assert not is_manifest(str(tmp_path / "missing.toml"))
    assert is_manifest(written(tmp_path, "no toml"))  # which is told when it is read


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("probes = [", "no TOML"),
        ("x = " + "[" * 10_000, "TOML|nested"),
        ("probes = 3", "'probes' is no list of texts"),
        ("brdfs = ['phong']", "names no probes"),
        ("probes = ['a']\nentry = 3", r"write \[\[entry\]\]"),
        ("probes = ['a']\nto = ['irradiance']\nirradiance = 3", r"write \[irradiance\]"),
        ("probes = ['a']\nto = ['irradiance']\nreading = 3", r"write \[reading\]"),
        ("probes = ['a']\nto = ['irradiance']\n[reading]\nspeed = 3", "'speed' says nothing"),
        ("probes = ['a']\nto = ['irradiance']\n[reading]\nclamp = -1", "'clamp' must be"),
        ("probes = ['a']\nto = ['irradiance']\n[reading]\npixels = 1", "'pixels' says nothing"),
        ("probes = ['a']\nto = ['irradiance']\nprecision = 'low'", "'precision' is none of"),
        ("probes = ['a']\nto = ['irradiance']\noutput = 3", "'output' is no text"),
        ("probes = ['a']\nto = ['irradiance']\nbrdf = 'phong'", r"write brdfs = \[...\]"),
        ("probes = ['a']\nbrdfs = ['phong']\neps = 7", "'eps' 7 is not a number between 0 and 1"),
        ("probes = ['a']\nbrdfs = ['phong']\nbeps = 7", "'beps' is no argument"),
        ("probes = ['a']", "'brdf' is missing"),
    ],
)
def test_unsound_manifests_are_refused_in_one_line(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(ProbeError, match=said) as caught:
        read_manifest(path)
    assert str(caught.value).startswith(path)
    assert "\n" not in str(caught.value)


@given(st.data())
def test_damaged_manifests_are_read_or_refused(data):
    """Bytes are changed, cut out and doubled; whatever comes of it, nothing else is raised."""
    text = bytearray(WHOLE.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text) - 1))
        stop = min(start + data.draw(st.integers(1, 30)), len(text))
        chosen = data.draw(st.sampled_from(["cut", "double", "change"]))
        if chosen == "cut" and stop - start < len(text):
            del text[start:stop]
        elif chosen == "double":
            text[start:start] = text[start:stop]
        else:
            text[start] = data.draw(st.integers(0, 255))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bake.toml"
        path.write_bytes(bytes(text))
        try:
            entries = read_manifest(str(path))
        except ProbeError as error:
            assert "\n" not in str(error)  # noqa: PT017
        else:
            assert all(entry.recipes() for entry in entries)


def test_a_manifest_runs_no_code(tmp_path):
    """A BRDF that is a class in a Python file is run only where the user names it."""
    from tests.batch.helpers import records_of, write_probes

    ran = tmp_path / "ran"
    (tmp_path / "mine.py").write_text(f"open({str(ran)!r}, 'w')\n")
    (probe,) = write_probes(tmp_path / "p", 1)
    (entry,) = read_manifest(
        written(
            tmp_path,
            f"probes = ['{probe}']\nbrdfs = ['{tmp_path}/mine.py:Mine']\n"
            f"output = '{tmp_path}/o.exr'\n",
        )
    )
    (record,) = records_of(entry)
    assert record["status"] == "failed"
    assert "names code" in record["error"]
    assert not ran.exists()
