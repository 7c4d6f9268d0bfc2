"""`shrm report` and `shrm contact`: the pages they write, their numbers, and what they refuse."""

import base64
import html
import json
import re
import zlib
from html.parser import HTMLParser

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.render.seen import can_flip
from shrm_cli.report import contact
from tests.batch.helpers import work_here
from tests.cli.helpers import assert_refused, done, noise, run, snapshot, write_exr

SMALL = ["--view", "10,20", "--picture-size", "16", "--truth-height", "16"]
SUMMED = [*SMALL, "--exact", "--no-flip"]
"""A sum over few pixels, for what does not depend on how a truth is found."""
EVIL = "x--><b onload=alert(1)>'\"&.exr"


class Page(HTMLParser):
    """What a page is made of; raises where elements are not closed in their order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.texts, self.is_continued = [], [], [], False
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag == "wbr":
            self.is_continued = True
        elif tag not in ("meta", "link", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.is_continued:  # a line may break here
            self.texts[-1] += data
        else:
            self.texts.append(data)
        self.is_continued = False

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def read(name):
    with open(name, encoding="utf-8") as file:
        text = file.read()
    return text, Page(text)


def assert_self_contained(page):
    """No script of its own, no handler, no address outside the page but links to files beside."""
    allowed = {"html", "head", "meta", "title", "link", "style", "body", "main", "header", "nav"}
    allowed |= {
        "section",
        "h1",
        "h2",
        "h3",
        "p",
        "b",
        "a",
        "code",
        "pre",
        "div",
        "span",
        "br",
        "wbr",
    }
    allowed |= {"table", "thead", "tbody", "tr", "th", "td", "dl", "dt", "dd", "details"}
    allowed |= {"summary", "figure", "figcaption", "img", "svg", "circle", "text", "iframe"}
    assert {tag for tag, _ in page.tags} <= allowed
    for _, attributes in page.tags:
        assert not [name for name in attributes if name.startswith("on") or name == "style"]
        assert attributes.get("src", "data:").startswith("data:")
        assert attributes.get("href", "#").startswith(("#", "./", "../", "data:,"))
    (policy,) = [each["content"] for each in page.all("meta") if "http-equiv" in each]
    assert policy.startswith("default-src 'none';")
    assert "unsafe" not in policy
    assert "http:" not in policy
    assert "https:" not in policy


def decoded(source):
    """The pixels of a PNG in a data URI, by an inverse of the filters that is slow and plain."""
    data = base64.b64decode(source.removeprefix("data:image/png;base64,"))
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    place, chunks = 8, {}
    while place < len(data):
        size = int.from_bytes(data[place : place + 4], "big")
        kind, body = data[place + 4 : place + 8], data[place + 8 : place + 8 + size]
        check = int.from_bytes(data[place + 8 + size : place + 12 + size], "big")
        assert zlib.crc32(kind + body) == check
        chunks[kind] = body
        place += 12 + size
    width, height = (int.from_bytes(chunks[b"IHDR"][k : k + 4], "big") for k in (0, 4))
    count = {2: 3, 6: 4}[chunks[b"IHDR"][9]]
    lines = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, -1)
    rows = np.zeros((height, width * count), np.uint8)
    for y, (kind, *values) in enumerate(lines.tolist()):
        for x, value in enumerate(values):
            left = int(rows[y, x - count]) if x >= count else 0
            above = int(rows[y - 1, x]) if y else 0
            rows[y, x] = (value + (0, left, above)[kind]) % 256
    return rows.reshape(height, width, count)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a probe, brighter on one side and below a lamp."""
    monkeypatch.chdir(tmp_path)
    light = np.ones((16, 32, 3), dtype=np.float32) + np.arange(32)[None, :, None] / 8
    light[4, 9] = 300
    write_exr("probe.exr", light.astype(np.float32))
    return tmp_path


def test_the_numbers_are_those_of_prefilter_and_compare(folder):
    spec, turned = "ggx:roughness=0.6,f0=gold", ("--yaw", "30")
    forms = ["--to", "principal", "--to", "splitsum", "--levels", "2", "--size", "8"]
    out = json.loads(
        done(
            "report",
            "probe.exr",
            "--brdf",
            spec,
            *forms,
            *SMALL,
            "--exact",
            *turned,
            "-o",
            "a.html",
            "--json",
        )
    )
    text, page = read("a.html")
    assert_self_contained(page)
    assert out["bytes"] == (folder / "a.html").stat().st_size
    assert out["failures"] == []
    assert out["probe"] == {
        key: each for key, each in json.loads(done("info", "probe.exr", *turned, "--json")).items()
        if key in out["probe"]
    }  # fmt: skip
    given = {"principal": ["--brdf", spec], "splitsum": ["--levels", "2"]}
    assert [each["representation"] for each in out["maps"]] == list(given)
    for found in out["maps"]:
        form = found["representation"]
        options = [*given[form], "--to", form, "--size", "8", "-o", found["file"], "--json"]
        made = json.loads(done("prefilter", "probe.exr", *turned, *options))
        own = {"warnings", "file"}
        assert {key: found[key] for key in made.keys() - own} == {
            key: made[key] for key in made.keys() - own
        }
        (told,) = (each for each in page.texts if each.startswith(f"shrm compare {found['file']} "))
        words = told.replace(" PROBE ", " probe.exr ").split()[1:]
        compared = json.loads(done(*words, "--no-picture", "--json"))
        (expected,) = compared["summary"]
        del expected["file"]
        assert found["measured"] == expected
        assert expected["relative_rmse"] > 0
        shown = [float(each) for each in re.findall(r">([\d.]+) %<", text)]
        assert float(f"{expected['relative_rmse'] * 100:.2g}") in shown


def test_maps_are_those_that_the_shortest_command_makes(folder):
    """They were made by another form and another tolerance, which no other default is."""
    light = np.ones((32, 64, 3), dtype=np.float32) + np.arange(64)[None, :, None] / 8
    light[8, 18] = 300
    write_exr("probe.exr", light.astype(np.float32))
    asked = ["--brdf", "ggx:roughness=0.3", "--max-size", "40kB"]
    made = json.loads(done("prefilter", "probe.exr", *asked, "--json"))
    out = done("report", "probe.exr", *asked, *SUMMED, "--no-view", "-o", "a.html", "--json")
    (found,) = json.loads(out)["maps"]
    assert found["file"] == made["file"]
    assert {key: found[key] for key in made.keys() - {"warnings"}} == {
        key: made[key] for key in made.keys() - {"warnings"}
    }
    _, page = read("a.html")
    assert f"{made['representation']} (auto)" in page.texts
    assert "Form" in page.texts
    assert any("lamps beside it: no map of 40 kB with them in it" in each for each in page.texts)


def test_pictures_and_the_view_are_in_the_page(folder):
    done("report", "probe.exr", "--brdf", "phong:exponent=8", *SMALL, "-o", "a.html")
    text, page = read("a.html")
    pictures = page.all("img")
    spheres = [each for each in pictures if each["width"] == "16"]
    columns = 3 + 2 * ("darker" in text) + can_flip()
    assert len(spheres) == columns
    truth = decoded(spheres[0]["src"])
    assert truth.shape == (16, 16, 4)
    assert truth[0, 0, 3] == 0
    assert truth[8, 8, 3] == 255
    assert truth[8, 8, :3].min() > 0
    (frame,) = page.all("iframe")
    assert frame["sandbox"] == "allow-scripts allow-downloads"
    inner = re.findall(r"'sha256-[^']*'", frame["srcdoc"])
    outer = next(each["content"] for each in page.all("meta") if "http-equiv" in each)
    # The policy of the page holds within the frame, too.
    assert all(digest in outer for digest in inner)
    assert len(inner) == 2
    done("report", "probe.exr", "--brdf", "phong", *SUMMED, "--no-view", "-o", "b.html")
    assert read("b.html")[1].all("iframe") == []


def test_the_bar_rises_all_the_time(folder):
    """It stood at 50 % while two of the three truths, and the one of the view, were integrated."""
    told = []
    shrm.report(
        "probe.exr", ["phong:exponent=20"], ["shrm"], picture_size=16, exact=True, flips=False,
        progress=lambda done, total: told.append(done / total),
    )  # fmt: skip
    assert told[-1] == 1
    assert np.diff([0, *told]).min() >= 0
    assert np.diff([0, *told]).max() < 0.2


def test_names_are_escaped(folder):
    (folder / "probe.exr").rename(folder / EVIL)
    done("report", EVIL, "--brdf", "phong", *SUMMED, "-o", "a.html")
    text, page = read("a.html")
    assert_self_contained(page)
    assert EVIL in page.texts
    assert EVIL not in text
    (frame,) = page.all("iframe")
    assert EVIL not in frame["srcdoc"]
    done("prefilter", EVIL, "--brdf", "phong", "-o", "map <i>.exr", "--quiet")
    done("contact", "map <i>.exr", "--title", "<script>", "-o", "c.html")
    text, page = read("c.html")
    assert_self_contained(page)
    assert EVIL in page.texts
    assert "./map%20%3Ci%3E.exr" in [each.get("href") for each in page.all("a")]


def test_pages_name_files_of_brdfs_without_their_folders(folder):
    """But for the command line and its options, which stand as they were typed."""
    (folder / "secret").mkdir()
    done("brdf", "phong", "--save", "secret/paint.exr", "--quiet")
    brdf = ("--brdf", "secret/paint.exr")
    done("report", "probe.exr", *brdf, *SUMMED, "--to", "shrm", "--no-view", "-o", "a.html")
    _, page = read("a.html")
    command, option = (text for text in page.texts if "secret" in text)
    assert command.startswith("shrm report probe.exr --brdf secret/paint.exr ")
    assert option == "secret/paint.exr"
    assert page.texts.count("paint.exr") == 3  # a link, a row and a heading


def test_a_brdf_that_fails_is_said_and_the_others_are_there(folder):
    (folder / "bad.binary").write_bytes(b"no samples")
    brdfs = "--brdf", "bad.binary", "--brdf", "phong"
    result = run("report", "probe.exr", *brdfs, *SUMMED, "-o", "a.html")
    assert result.code == 1
    assert re.fullmatch(r"Failed: bad.binary, auto: [^\n]*\n", result.err)
    text, page = read("a.html")
    assert "bad.binary, auto" in page.texts
    assert html.escape("phong") in text
    assert len(page.all("iframe")) == 1


def test_a_brdf_that_does_not_exist_is_refused_before_others_are_made(folder):
    brdfs = "--brdf", "phong", "--brdf", "nonsense"
    assert_refused(run("report", "probe.exr", *brdfs, "-o", "a.html"), 1, "'nonsense'")
    assert not (folder / "a.html").exists()


@pytest.mark.proof
def test_product_textures_are_reported(folder):
    """As other maps are, with the order of their light and a view."""
    asked = ["--brdf", "ward", "--to", "product", "--order", "2", "--texels", "16", *SMALL]
    out = done("report", "probe.exr", *asked, "-o", "product.html")
    assert re.search(r"ward, product: RMS [\d.]+ %", out)
    _, page = read("product.html")
    assert "F 2" in page.texts
    (frame,) = page.all("iframe")
    assert "shrm_lighting" in frame["srcdoc"]


@pytest.mark.proof
def test_views_of_small_pages_have_smaller_maps(folder):
    forms = ["--to", "principal", "--to", "splitsum", "--size", "128"]
    common = ["report", "probe.exr", "--brdf", "ggx:roughness=0.6", *forms, *SMALL, "--no-flip"]
    done(*common, "--quiet", "-o", "a.html")
    whole = read("a.html")[1].all("iframe")[0]["srcdoc"]
    assert all(f'"name":"probe.{name}"' in whole for name in ("ggx-roughness-0.6.principal",
               "splitsum"))  # fmt: skip
    result = run(*common, "-o", "b.html", "--max-page", "1.3MB")
    assert result.code == 0
    assert "the view of ggx:roughness=0.6 is without splitsum, and has maps with 1/" in result.err
    small = read("b.html")[1].all("iframe")[0]["srcdoc"]
    assert '"name":"probe.ggx-roughness-0.6.principal"' in small
    assert '"name":"probe.splitsum"' not in small
    assert (folder / "b.html").stat().st_size < 1.3e6 < (folder / "a.html").stat().st_size


def test_a_page_keeps_its_limit(folder):
    common = ["report", "probe.exr", "--brdf", "phong", *SUMMED, "-o", "a.html", "--max-page"]
    result = run(*common, "1MB")
    assert result.code == 0
    assert "no view of phong" in result.err
    assert (folder / "a.html").stat().st_size < 10**6
    (folder / "a.html").unlink()
    assert_refused(run(*common, "1kB"), 1, "the page would take", "--max-page")
    assert not (folder / "a.html").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.exr", "--brdf", "phong", "-o", "a.html"], ["missing.exr"]),
        (["probe.exr", "--brdf", "phong", "-o", "a.exr"], ["a.exr", ".html"]),
        (["probe.exr", "--brdf", "phong", "-o", "none/a.html"], ["none"]),
        (["probe.exr", "--brdf", "phong", "-o", "link.html"], ["link.html", "overwrite"]),
    ],
)
def test_bad_input_is_refused_in_a_line(folder, arguments, words):
    (folder / "link.html").symlink_to("probe.exr")
    before = snapshot(folder)
    assert_refused(run("report", *arguments), 1, *words)
    assert snapshot(folder) == before


def test_usage_is_checked_before_work(folder):
    for arguments, word in [
        ([], "--brdf"),
        (["--brdf", "phong", "--to", "irradiance"], "--brdf"),
        (["--brdf", "phong", "--levels", "3"], "--levels"),
        (["--brdf", "phong", "--source-height", "8"], "--source-height applies with --to cabral"),
        (["--brdf", "phong", "--to", "cabral", "--source-height", "8"], "with --domain angular"),
        (["--brdf", "phong", "--domain", "angular"], "--domain applies with --to cabral"),
    ]:
        result = run("report", "probe.exr", *arguments, "-o", "a.html")
        assert (result.code, result.err.count("\n")) == (2, 1)
        assert word in result.err


def test_maps_of_light_alone_have_a_material_of_their_own(folder):
    out = json.loads(
        done("report", "probe.exr", "--to", "irradiance", *SUMMED, "--no-view", "-o", "a.html",
             "--json")
    )  # fmt: skip
    (found,) = out["maps"]
    assert found["representation"] == "irradiance"
    assert "lambertian" in "".join(read("a.html")[1].texts)
    light = "--to", "splitsum", "--levels", "3", "--size", "8"
    done("report", "probe.exr", *light, *SUMMED, "--no-view", "-o", "a.html")
    told = "".join(read("a.html")[1].texts)
    assert "--roughness 0.5" in told
    assert "ggx:roughness=0.5" in told


def test_contact_sheets_show_light_alone_as_pictures_do(folder):
    done("prefilter", "probe.exr", "--to", "splitsum", "--levels", "3", "--size", "8",
         "-o", "light.exr")  # fmt: skip
    (found,) = shrm.draw_contacts(["light.exr"]).maps
    made = shrm.open_map("light.exr")
    pictures = [
        contact.render_sphere(made.shaded(r), contact._VIEWER, contact.SIZE) for r in (0.5, 0.4)
    ]
    np.testing.assert_allclose(found.picture, pictures[0], rtol=1e-6)
    assert np.abs(found.picture - pictures[1]).max() > 0.01


def test_contact_sheets_have_a_row_for_each_probe(folder):
    write_exr("other.exr", np.full((16, 32, 3), 2, dtype=np.float32))
    for name in ("probe", "other"):
        for exponent in (4, 8) if name == "probe" else (4,):
            done("prefilter", f"{name}.exr", "--brdf", f"phong:exponent={exponent}", "--quiet",
                 "-o", f"maps{name}{exponent}.exr")  # fmt: skip
    (folder / "build" / "below").mkdir(parents=True)
    for path in folder.glob("maps*.exr"):
        path.rename(folder / "build" / "below" / path.name)
    (folder / "build" / "note.exr").write_text("no map")
    written = (folder / "build" / "below" / "mapsprobe4.exr").read_bytes()
    (folder / "build" / ".mapsprobe4.shrm-host-1-ab.exr").write_bytes(written)
    out = json.loads(done("contact", "build", "-o", "build/index.html", "--json"))
    names = ["mapsother4.exr", "mapsprobe4.exr", "mapsprobe8.exr"]
    assert out["maps"] == [f"build/below/{name}" for name in names]
    _, page = read("build/index.html")
    assert_self_contained(page)
    assert len(page.all("tr")) == 3
    assert len(page.all("td")) == 4
    assert [each["href"] for each in page.all("a")] == [f"./below/{name}" for name in names]
    assert len(page.all("img")) == 3
    (folder / "empty").mkdir()
    before = snapshot(folder)
    result = run("contact", "build", "build/note.exr", "-o", "build/index.html")
    assert (result.code, result.err.count("Failed: build/note.exr: ")) == (1, 1)
    assert_refused(run("contact", "build/below/mapsprobe4.exr", "-o", "probe.exr"), 1, "probe.exr")
    assert_refused(run("contact", "empty", "-o", "x.html"), 1, "0 maps")
    assert_refused(run("contact", "build/note.exr", "-o", "x.html"), 1, "build/note.exr: ")
    assert snapshot(folder).keys() == before.keys()


def test_forms_that_were_chosen_by_probe_share_a_column(folder):
    """A page of `make batch` had a column for each form, with holes where the other was chosen."""
    write_exr("other.exr", np.full((16, 32, 3), 2, dtype=np.float32))
    for name, forms in (("probe", ["shrm"]), ("other", ["principal", "shrm"])):
        for form in forms:
            done("prefilter", f"{name}.exr", "--brdf", "phong:exponent=4", "--to", form, "--quiet",
                 "-o", f"{name}.{form}.exr")  # fmt: skip
    done("contact", "probe.shrm.exr", "other.principal.exr", "-o", "c.html")
    _, page = read("c.html")
    assert (len(page.all("tr")), len(page.all("td"))) == (3, 2)
    assert {each.split(",")[0] for each in page.texts if ", F " in each} == {"shrm", "principal"}
    done("contact", "probe.shrm.exr", "other.principal.exr", "other.shrm.exr", "-o", "d.html")
    _, page = read("d.html")
    assert (len(page.all("tr")), len(page.all("td"))) == (3, 4)


def test_contact_sheets_say_no_error_that_is_not_the_maps(folder):
    """SH exponentials had 0 %, whatever their fit leaves, and split sums that of their levels."""
    for form in ("she", "splitsum"):
        done("prefilter", "probe.exr", "--to", form, "-o", f"{form}.exr", "--quiet")
    told = json.loads(done("info", "she.exr", "--json"))
    done("contact", "she.exr", "splitsum.exr", "-o", "two.html")
    _, page = read("two.html")
    cells = [each for each in page.texts if each.endswith(("%", "B"))]
    assert len(cells) == 2
    assert float(cells[0].split(", ")[1].split()[0]) == pytest.approx(
        100 * told["fit_residual"], rel=0.06
    )
    assert "%" not in cells[1]


def test_contact_sheets_say_what_look_ups_add(folder):
    """Which is most of the error of a map with few texels, and was left out."""
    asked = ["--brdf", "phong:exponent=8", "--to", "principal", "--size", "8", "-o", "small.exr"]
    made = json.loads(run("prefilter", "probe.exr", *asked, "--json").out)
    whole = np.hypot(made["predicted_error"], made["filter_error"])
    assert whole > 1.2 * made["predicted_error"]
    done("contact", "small.exr", "-o", "one.html")
    (cell,) = [each for each in read("one.html")[1].texts if each.endswith(" %")]
    assert float(cell.split(", ")[1].split()[0]) == pytest.approx(100 * whole, rel=0.06)


TUBE = "--brdf", "phong:exponent=32", "--sun", "split", "--to", "shrm"


def discs_of_a_tube(folder):
    """Prefilter a lamp that is no disc, and return what is told of the map."""
    pixels = noise(64, 128) / 4
    pixels[20, 40:44] = 300
    write_exr(folder / "tube.exr", pixels)
    return json.loads(run("prefilter", "tube.exr", *TUBE, "-o", "discs.exr", "--json").out)


def test_reports_do_not_deny_large_lamps(folder):
    """One of 20 degrees is beside the map, though none is small enough to be listed."""
    pixels = np.full((32, 64, 3), 0.02, np.float32)
    pixels[8:13, 20:27] = 20
    write_exr("box.exr", pixels)
    done("report", "box.exr", "--to", "irradiance", *SUMMED, "--no-view", "-o", "a.html")
    texts = read("a.html")[1].texts
    assert "No lamp of a radius below 8\u00b0 stands out." in texts


def test_reports_say_what_discs_change(folder):
    """They were told of errors of next to nothing, which only the map within has."""
    made = discs_of_a_tube(folder)
    out = done("report", "tube.exr", *TUBE, *SUMMED, "--no-view", "-o", "a.html", "--json")
    (found,) = json.loads(out)["maps"]
    assert found["lamp_error"] == made["lamp_error"] > 0.5 * made["predicted_error"] > 0
    _, page = read("a.html")
    cells = page.texts[page.texts.index("Predicted") :]
    cells = cells[cells.index("Time") :]
    predicted = next(each for each in cells if re.fullmatch(r"[\d.]+\s%", each))
    causes = "lamp", "predicted", "added"
    whole = np.linalg.norm([made[f"{each}_error"] for each in causes])
    assert float(predicted.split()[0]) == pytest.approx(100 * whole, rel=0.02)


def test_contact_sheets_say_what_discs_change(folder):
    """They lie beside the map in place of lamps, and their error was left out."""
    made = discs_of_a_tube(folder)
    assert made["lamp_error"] > 0.5 * made["predicted_error"] > 0
    done("contact", "discs.exr", "-o", "one.html")
    (cell,) = [each for each in read("one.html")[1].texts if each.endswith(" %")]
    whole = np.linalg.norm([made[f"{each}_error"] for each in ("lamp", "predicted", "filter")])
    assert float(cell.split(", ")[1].split()[0]) == pytest.approx(100 * whole, rel=0.06)


def test_batches_have_contact_sheets(folder, monkeypatch):
    work_here(monkeypatch)
    result = run("batch", "probe.exr", "note.exr", "--brdf", "phong", "--jobs", "1", "--contact",
                 "all.html", "--quiet")  # fmt: skip
    assert result.code == 1
    _, page = read("all.html")
    assert [each["href"] for each in page.all("a")] == ["./probe.phong.auto.exr"]
    assert "note.phong.auto.exr" in page.texts
