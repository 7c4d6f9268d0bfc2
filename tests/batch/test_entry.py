"""What batches make: products of probes, BRDFs and forms, and the names of their outputs."""

import re
import shutil

import pytest

from shrm_cli.batch.entry import Entry, checked, found_probes
from shrm_cli.batch.job import by_probe, cut_for_workers
from shrm_cli.errors import ArgumentError, BrdfError, OutputError, ProbeError
from tests.batch.helpers import write_probes
from tests.cli.helpers import ROOT, done, run


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with probes in two folders below it."""
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path / "probes/day", 2)
    write_probes(tmp_path / "probes/night", 2)
    return tmp_path


def outputs(entry):
    return [job.output for job in checked(entry.jobs())]


def test_the_product_of_probes_brdfs_and_forms(folder):
    entry = Entry(
        ("probes/day/*.exr",), ("phong:exponent=8", "lambertian"), ("shrm", "irradiance"),
        "out/{probe}.{brdf}.{to}.exr",
    )  # fmt: skip
    assert outputs(entry) == [
        "out/p0.phong-exponent-8.shrm.exr", "out/p0.lambertian.shrm.exr", "out/p0.irradiance.exr",
        "out/p1.phong-exponent-8.shrm.exr", "out/p1.lambertian.shrm.exr", "out/p1.irradiance.exr",
    ]  # fmt: skip


def test_folders_below_the_pattern_s_own_keep_outputs_apart(folder):
    entry = Entry(("probes/**/*.exr",), (), ("irradiance",), "o/{folder}/{probe}.exr")
    assert outputs(entry) == [
        "o/day/p0.exr", "o/day/p1.exr", "o/night/p0.exr", "o/night/p1.exr",
    ]  # fmt: skip
    flat = Entry(("probes/day/*.exr",), (), ("irradiance",), "o/{folder}/{probe}.exr")
    assert outputs(flat) == ["o/p0.exr", "o/p1.exr"]


def test_a_name_that_exists_is_no_pattern(folder):
    write_probes(folder / "odd", 1)[0]
    (folder / "odd/p0.exr").rename(folder / "odd/a[1].exr")
    assert found_probes(["odd/a[1].exr"]) == [("odd/a[1].exr", "")]
    assert found_probes(["nothing.exr"]) == [("nothing.exr", "")]  # its job will fail by its name


def test_patterns_pass_over_what_shrm_wrote(tmp_path, monkeypatch):
    """Maps, tables, pictures, pages and exports; probes that it wrote are probes."""
    monkeypatch.chdir(tmp_path)
    for path in (ROOT / "probes").glob("*.exr"):
        shutil.copy(path, tmp_path)
    done("probe", "sky", "--size", "8", "-o", "sky.exr")
    done("convert", "sky.exr", "--to", "strip", "--size", "4")
    probes = {path.name for path in tmp_path.iterdir()}
    (tmp_path / "damaged.exr").write_bytes((tmp_path / "sky.exr").read_bytes()[:30])
    (tmp_path / "empty.exr").write_bytes(b"")
    probes |= {"damaged.exr", "empty.exr"}
    done("prefilter", "sky.exr", "--to", "irradiance")
    done("render", "sky.irradiance.exr", "--size", "16", "-o", "picture.exr")
    done("dfg", "--size", "4")
    done("prefilter", "sky.exr", "--brdf", "lambertian", "-o", "matte.exr")
    done("convert", "matte.exr", "--to", "layers")
    for engine in ("unity", "unreal"):  # an .exr and a .hdr of which nothing tells whose they are
        run("export", "sky.exr", "--for", engine, "--size", "8")
    (tmp_path / "batch.jsonl").write_text("{}")
    left_out = []
    found = {name for name, _ in found_probes(["**/*"], left_out)}
    everything = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")
                  if path.is_file()}  # fmt: skip
    assert found == probes
    assert set(left_out) == everything - probes
    assert len(left_out) > 8
    (named, *_) = found_probes(["sky.irradiance.exr", "*.exr"])
    assert named == ("sky.irradiance.exr", "")


@pytest.mark.parametrize("suffix", ["usda", "json", "USDA"])
def test_patterns_that_name_the_suffix_of_stages_and_coefficients_take_them(
    tmp_path, monkeypatch, suffix
):
    """Others pass over them, as over what else they match and is no probe."""
    monkeypatch.chdir(tmp_path)
    for name in (f"mine.{suffix}", f"a.{suffix}", "a.gif", "a.mp4", "a.glb", "a_export.json"):
        (tmp_path / name).write_text("x")
    exported = "Light of a.exr for USD, by shrm 0.2.0. Linear RGB.\nFiles: `a.{}`.\n"
    (tmp_path / "a_README.md").write_text(exported.format(suffix))
    assert found_probes([f"*.{suffix}"]) == [(f"mine.{suffix}", "")]
    (tmp_path / "b.exr").write_text("x")
    assert found_probes(["*"]) == [("b.exr", "")]


def test_a_pattern_that_matches_nothing_is_refused(folder):
    with pytest.raises(ProbeError, match=r"none/\*\.exr: matches no file"):
        Entry(("none/*.exr",), (), ("irradiance",)).jobs()


def test_a_pattern_that_no_name_can_match_is_refused_at_once(folder):
    """Python's `glob` takes minutes for a hundred thousand brackets."""
    with pytest.raises(ProbeError, match="too long for a pattern") as caught:
        Entry(("[" * 5000,), (), ("irradiance",)).jobs()
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"output": "o/{probe}.{to}.exr", "probes": ("probes/**/*.exr",)}, "put {folder}"),
        ({"output": "o/{probe}.{to}.exr", "brdfs": ("lambertian", "phong")}, "put {brdf}"),
        ({"output": "o/{probe}.{brdf}.exr", "to": ("shrm", "cabral")}, "put {to}"),
        ({"output": "o/{probe}.exr", "to": ("shrm", "irradiance")}, "of two forms; put {to}"),
        (
            {"output": "o/{probe}.exr", "probes": ("probes/day/p0.exr", "./probes/day/p0.exr")},
            "of probes/day/p0.exr and of ./probes/day/p0.exr, which is the same file; name it once",
        ),
        ({"output": "probes/day/{probe}.exr"}, "would overwrite the input"),
        ({"output": "o/{probe}.{to}.png"}, "what is written is .exr"),
        ({"output": "o/{name}.exr"}, "{name} stands for nothing"),
        ({"output": "o/{probe.__class__}.exr"}, "stands for nothing"),
    ],
)
def test_names_of_outputs_that_cannot_be(folder, changes, said):
    entry = Entry(**{"probes": ("probes/day/*.exr",), "brdfs": ("lambertian",), **changes})
    with pytest.raises(OutputError) as caught:
        outputs(entry)
    assert said in str(caught.value)


def test_probes_of_a_folder_whose_names_come_out_alike_are_to_be_renamed(folder):
    """A ``%`` is left out of names of outputs; `{folder}`, which was advised, is there already."""
    for name in ("a%b.exr", "ab.exr"):
        (folder / name).write_bytes((folder / "probes/day/p0.exr").read_bytes())
    with pytest.raises(OutputError, match=r"of a%b\.exr and of ab\.exr; rename one of the probes"):
        outputs(Entry(("a*.exr",), (), ("irradiance",), "o/{folder}/{probe}.exr"))


def test_no_output_is_a_measured_file_that_is_read(folder):
    (folder / "paint.exr").write_bytes((folder / "probes/day/p0.exr").read_bytes())
    with pytest.raises(OutputError, match=r"paint\.exr: would overwrite the input"):
        outputs(Entry(("probes/day/p0.exr",), ("./paint.exr",), ("shrm",), "paint.exr"))


def test_each_form_gets_the_options_that_it_obeys(folder):
    entry = Entry(
        ("probes/day/p0.exr",), ("lambertian",), ("shrm", "irradiance", "splitsum"),
        arguments={"eps": 0.1, "size": 8}, own={"irradiance": {"window": "auto", "size": 16}},
    )  # fmt: skip
    assert [recipe.arguments for recipe in entry.recipes()] == [
        {"eps": 0.1, "size": 8}, {"size": 16, "window": "auto"}, {"size": 8},
    ]  # fmt: skip


def test_split_sums_are_of_the_brdfs_unless_these_are_for_other_forms(folder):
    def specs(*forms):
        recipes = Entry(("probes/day/p0.exr",), ("charlie", "ward"), forms).recipes()
        return [(recipe.to, recipe.brdf) for recipe in recipes]

    split = [("splitsum", "charlie"), ("splitsum", "ward")]
    assert specs("splitsum") == split
    assert specs("irradiance", "splitsum") == [("irradiance", None), *split]
    mixed = [("principal", "charlie"), ("principal", "ward"), ("splitsum", None)]
    assert specs("principal", "splitsum") == mixed


@pytest.mark.parametrize(
    ("changes", "argument"),
    [
        ({"arguments": {"levels": 3}}, "levels"),  # of split sums, which are not made
        ({"arguments": {"eps": 2}}, "eps"),
        ({"arguments": {"nonsense": 1}}, "nonsense"),
        ({"arguments": {"shader": "glsl"}}, "shader"),  # prints, and makes nothing
        ({"own": {"she": {"p_order": 2}}}, "to"),
        ({"own": {"irradiance": {"slices": 2}}}, "slices"),
        ({"to": ("mystery",)}, "to"),
        ({"brdfs": ()}, "brdf"),
        ({"to": ("irradiance",)}, "brdf"),
    ],
)
def test_options_that_say_nothing_are_refused(folder, changes, argument):
    entry = Entry(
        **{"probes": ("probes/day/*.exr",), "brdfs": ("phong",), "to": ("shrm", "irradiance")}
        | changes
    )
    with pytest.raises(ArgumentError) as caught:
        entry.jobs()
    assert caught.value.argument == argument


def test_chunks_are_cut_for_workers(folder):
    entry = Entry(("probes/day/*.exr",), (), ("irradiance", "splitsum", "she"))
    chunks = by_probe(entry.jobs())
    assert [len(chunk.jobs) for chunk in chunks] == [3, 3]
    assert cut_for_workers(chunks, 2) == chunks
    parts = cut_for_workers(chunks, 4)
    assert [len(part.jobs) for part in parts] == [2, 1, 2, 1]
    assert [job for part in parts for job in part.jobs] == [j for c in chunks for j in c.jobs]
    assert [len(part.jobs) for part in cut_for_workers(chunks, 100)] == [1] * 6


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("ggx:roughness=.6", "all roughnesses are made; leave roughness out"),
        ("ggx:f0=0.04", "leave it out"),
        ("ward:ax=0.1,ay=0.3", "a lobe that is the same all around"),
        ("ggxx", "no BRDF is called 'ggxx'"),
    ],
)
def test_a_brdf_of_which_no_probe_has_a_map_is_refused_before_the_work(spec, words):
    with pytest.raises(BrdfError, match=re.escape(words)):
        Entry(("a.exr", "b.exr"), (spec,), ("splitsum",)).recipes()
    for others in ((), ("charlie",)):
        assert Entry(("a.exr",), others, ("splitsum",)).recipes()
