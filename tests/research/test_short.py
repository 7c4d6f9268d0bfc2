"""The short forms of `make tables` and `make survey`, with the probes of a clean clone."""

import re

import pytest

from research import __main__ as tables
from research import page_survey, survey
from research.extent import SHORT
from research.inputs import NAMES, Page, equal_probes, probe_files
from shrm_cli.errors import BrdfError
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where both programs wrote their pages, without real probes."""
    folder = tmp_path_factory.mktemp("paper")
    for survey_too in ([], ["--survey"]):
        none = str(folder / "none")
        tables.main(
            [str(folder / "pages"), "--short", "--probes", none, "--meshes", none, *survey_too]
        )
    return folder / "pages"


@pytest.mark.proof
def test_the_tables_have_all_their_parts(folder):
    page = (folder / "index.md").read_text()
    titles = re.findall(r"^## ([^:,\n]*)", page, re.MULTILINE)
    assert titles == [
        "Table 5.4", "Table 5.5", "Figure 4.1", "Figure 4.3", "Figure 5.4", "Figure 5.5",
        "Figure 5.6", "Figure 5.7", "Figure 5.8", "Figure 5.9", "Figure 5.9", "Chapter 4",
        "SH exponentials and the split sum",
    ]  # fmt: skip
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", page)
    assert len(pictures) == 9
    assert all((folder / picture).stat().st_size > 1000 for picture in pictures)


@pytest.mark.proof
def test_the_tables_say_what_was_replaced_and_by_what(folder):
    page = " ".join((folder / "index.md").read_text().split())
    assert "61 materials of the CUReT database, whose measurements are not at hand" in page
    assert SHORT.materials[0] in page
    assert "velvet is replaced by a microfacet lobe of sigma .5" in page


@pytest.mark.proof
def test_product_textures_have_all_figures_that_need_no_models_of_the_paper(folder):
    page = (folder / "product.md").read_text()
    titles = re.findall(r"^## ([^:\n]*)", page, re.MULTILINE)
    assert titles == [
        "Figure 2", "Figure 3", "Figure 4", "Figures 5 and 7", "Figure 6", "Figure 8",
        "Incident light field",
    ]  # fmt: skip
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", page)
    assert len(pictures) == 7
    assert all((folder / picture).stat().st_size > 1000 for picture in pictures)
    assert f"knot ({10 * SHORT.product_rows**2} vertices), and a vase" in " ".join(page.split())


@pytest.mark.proof
def test_the_numbers_of_product_textures_are_in_range(folder):
    page = (folder / "product.md").read_text()
    bands = [share(line[2]) for line in rows_of(page, "Figure 2")]
    assert len(bands) == 5
    assert 0.5 < sum(bands) < 0.7  # a lobe of exponents (24, 8) is wider than a mirror
    turned = float(re.search(r"differ from the turned ones by (\S+)", page)[1])
    assert turned < 1e-6
    for what, left, change, wrong in (
        (line[0], float(line[2]), share(line[3]), share(line[4]))
        for line in rows_of(page, "Figures 5 and 7")
    ):
        assert 0.5 < left < 0.95, what
        assert (change > 0.05) == (what != "isotropic")
        assert wrong < 0.15, what
    left, middle, right = rows_of(page, "Incident light field")
    for line in (left, right):
        one, grid, own = (share(cell) for cell in line[1:4])
        assert own < grid < 0.5 * one, line
    # In the middle of the room the light is nearly that of the one probe.
    assert share(middle[1]) < share(left[1]) / 2
    for line in rows_of(page, "Figure 6"):
        predicted, measured = share(line[2]), share(line[3])
        assert 0.75 * predicted < measured < 1.25 * predicted


def rows_of(page, title):
    """The cells of the table of a part of a page, line by line, without its head."""
    part = page.split(f"\n## {title}:")[1].split("\n## ")[0]
    lines = [line for line in part.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def share(text):
    """The number that a percentage stands for."""
    return float(text.rstrip("%")) / 100


@pytest.mark.proof
def test_what_is_seen_is_told_of_both_shipped_probes(folder):
    page = (folder / "seen.md").read_text()
    assert "2 probes (studio, sky), averaged down to 32 rows" in page
    for spec in SHORT.seen:
        section = page.split(f"\n## {spec}\n\n")[1].split("\n\n")[0]
        assert {line.split(" | ")[0] for line in section.splitlines()[2:]} == {"| studio", "| sky"}


@pytest.mark.proof
def test_the_survey_has_a_row_for_each_brdf_and_probe(folder):
    page = (folder / "brdfs.md").read_text()
    assert "- refused: 0 of 8 maps" in page
    for probe in ("studio", "sky"):
        lines = page.split(f"\n## {probe}\n\n")[1].split("\n\n")[0].splitlines()
        assert [line.split(" | ")[0] for line in lines[2:]] == [f"| `{s}`" for s in SHORT.survey]
        assert {line.count("|") for line in lines} == {13}


def test_the_survey_marks_what_takes_too_much_and_what_is_refused():
    good = survey.Outcome("ggx", "sky", "shrm", 9.0, 31e6, 0.1, 0.2, 0.0)
    slow = survey.Outcome("ggx", "sky", "principal", 11.0, 33e6, 0.1, 0.2, 0.0)
    refused = [survey.Outcome("x", "sky", form, 1.0, refused="why") for form in survey.FORMS]
    assert good.marks == []
    assert slow.marks == ["slow", "large"]
    page = "\n".join(page_survey.survey([good, slow, *refused], 64))
    assert "- more than 10 s: 1 of 4 maps\n  - `ggx` under sky, principal: 11.0 s, 33.0 MB" in page
    assert "- refused: 2 of 4 maps\n  - `x` under sky, shrm: why" in page
    assert "| slow (principal), large (principal) |" in page


@pytest.mark.proof
def test_the_survey_goes_on_after_a_brdf_that_cannot_be_prefiltered():
    (probe,) = equal_probes(probe_files(ROOT / "none", ("studio",)), 16)
    specs = ("poulin-fournier", "lambertian")
    brushed, plain = survey.outcomes([probe], specs, picture=4)
    by_form = {each.form: each.refused for each in brushed}
    assert "anisotropic" in by_form["shrm"]
    assert by_form["principal"] == ""
    assert [each.refused for each in plain] == ["", ""]
    assert all(each.p95 < 0.1 for each in plain)


def test_the_survey_knows_every_model():
    from shrm_cli.brdf.library import built_in_names
    from shrm_cli.brdf.spec import parse_spec

    assert list(survey.SETTINGS) == built_in_names()
    assert all(
        len(many) >= 5 for name, many in survey.SETTINGS.items() if name != "poulin-fournier"
    )
    for spec in survey.all_specs():
        try:
            parse_spec(spec)
        except BrdfError as error:
            pytest.fail(str(error))


def test_real_probes_are_taken_where_they_are(tmp_path):
    for name in ("city", "night", "mine"):
        (tmp_path / f"{name}.exr").touch()
    assert probe_files(tmp_path) == [tmp_path / "city.exr", tmp_path / "night.exr"]
    assert probe_files(tmp_path, ("night",)) == [tmp_path / "night.exr"]
    shipped = [ROOT / "probes" / f"{name}.exr" for name in ("studio", "sky")]
    assert probe_files(tmp_path / "none") == shipped
    assert probe_files(tmp_path / "none", NAMES[:1]) == shipped[:1]


def test_shipped_probes_are_made_equally_large():
    files = probe_files(ROOT / "none")
    studio, sky = equal_probes(files)
    assert studio.image().shape == sky.image().shape == (128, 256, 3)
    assert studio.name == "studio"
    assert [each.height for each in equal_probes(files, most=32)] == [32, 32]


def test_a_page_is_on_disk_as_far_as_it_has_come(tmp_path):
    page = Page(tmp_path / "new" / "index.md")
    page.add("one\n")
    assert page.path.read_text() == "one\n"
    page.add("two\n")
    assert page.path.read_text() == "one\n\ntwo\n"
    page.write(["three"])
    assert page.path.read_text() == "three"
