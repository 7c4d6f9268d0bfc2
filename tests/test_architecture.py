"""The rules of the architecture, held by parsing what each module imports."""

import ast
import inspect
import sys
import tomllib
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from importlib.util import find_spec
from pathlib import Path

import pytest

from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.vocabulary import REPRESENTATIONS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "shrm_cli"
MODULES = sorted(PACKAGE.rglob("*.py"))

# The stops on the way from a probe to a picture; imports point only to earlier ones, or stay
# within their own. Stops beside each other do not know each other.
STOPS = [
    {"errors"},
    {"records"},
    {
        "arrays",
        "extras",
        "messages",
        "settings",
        "sources",
        "vocabulary",
        "bytecode",
    },
    {"progress", "plugins", "color"},
    {"sphere"},
    {"files"},
    {"geometry"},
    {"probe", "brdf"},
    {"orders", "reflected"},
    {"adaptive"},
    {"reference"},
    {"plan"},
    {"maps"},
    {"transfer", "lights", "forms"},
    {"automatic", "photo"},
    {"prefilter", "naming"},
    {"export"},
    {"batch", "rooms"},
    {"render"},
    {"view", "lookdev", "convert"},
    {"choose"},
    {"torch"},
    {"analysis"},
    {"report"},
    {"notebook"},
    {"cli"},
    {"__main__"},
]
USERS = {
    "OpenEXR": {"files"},
    "OpenImageIO": {"files", "probe"},
    "click": {"cli"},
    "tqdm": {"cli"},
}
"""The stops that alone may open images or talk to the terminal, by what they do it with."""
EXTRAS = {
    "analysis/plots.py": {"matplotlib"},
    "brdf/imported/materialx.py": {"MaterialX"},
    "batch/cluster.py": {"distributed", "dask", "threadpoolctl"},
    "batch/collect.py": {"pyarrow"},
    "export/blocks/astc.py": {"astc_encoder"},
    "export/ktx.py": {"zstandard"},
    "files/animation.py": {"PIL"},
    "files/remote.py": {"fsspec"},
    "probe/usd.py": {"pxr"},
    "render/seen.py": {"flip_evaluator"},
    "geometry/load.py": {"trimesh"},
    "geometry/rays.py": {"embreex"},
    "geometry/texels.py": {"xatlas"},
    **{
        name: {"torch"}
        for name in (
            "torch/exponential.py",
            "torch/light.py",
            "torch/principal.py",
            "torch/transforms.py",
        )
    },
}
"""What belongs to an extra, and is imported where it is used."""
ASKED_FOR = {"torch"}
"""Stops that import an extra as they are imported, which nothing else of the package does."""
LIGHT = {
    "__init__.py", "errors.py", "extras.py", "files/recipe.py", "files/whole.py",
    "maps/options.py", "maps/registry.py", "naming.py", "progress.py", "settings.py",
    "vocabulary.py",
    "bytecode.py", "messages.py", "records.py",
}  # fmt: skip
"""Modules that `shrm --help` may load, besides those of cli/."""
UNTRUSTED_LOADERS = {"pickle", "marshal", "shelve", "dill", "joblib"}
MOST_LINES = 500


def name(path):
    return path.relative_to(PACKAGE).as_posix()


def stop(path):
    """The stop that a module belongs to: its folder, or itself; "" for the package's own."""
    first = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return "" if first == "__init__" else first


BY_STOP = {}
for module in MODULES:
    BY_STOP.setdefault(stop(module), []).append(module)


def each_module(check):
    """Make a test for every stop of what is checked of a module: one for each of hundreds of
    modules takes longer to report than to run.
    """

    @pytest.mark.parametrize("here", BY_STOP, ids=lambda here: here or "shrm_cli")
    def checks(here):
        for path in BY_STOP[here]:
            try:
                check(path)
            except AssertionError as error:
                error.add_note(f"in {name(path)}")
                raise

    return checks


def rank(of):
    for index, stops in enumerate(STOPS):
        if of in stops:
            return index
    raise AssertionError(f"{of} has no place in the architecture; give it one in STOPS")


@dataclass(frozen=True)
class Source:
    """What the rules ask about a module, which is parsed once for all of them: its trees would
    fill a hundred megabytes.
    """

    imports: frozenset
    top_imports: frozenset
    run_time: frozenset
    docstring: str | None
    calls: frozenset
    attributes: frozenset


@cache
def source(path):
    tree = ast.parse(path.read_text())
    calls, attributes = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            calls.add(node.func.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            attributes.add((node.value.id, node.attr))
    nested, top = (frozenset(imported(path, tree, nested)) for nested in (True, False))
    late = frozenset(imported(path, tree, True, for_types=False))
    return Source(
        nested, top, late, ast.get_docstring(tree), frozenset(calls), frozenset(attributes)
    )


def imports(path, nested=True):
    """Full names that a module imports, as "a.b.c"; without nested ones only at its top level."""
    return source(path).imports if nested else source(path).top_imports


def run_time(path):
    """The modules of this package that a module imports sooner or later, but not for types."""
    return {module for each in source(path).run_time if (module := module_of(each)) is not None}


def imported(path, tree, nested, for_types=True):
    found = set()
    pending = list(ast.iter_child_nodes(tree))
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif is_for_types_only(node) and not (nested and for_types):
            continue
        elif nested or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            pending += ast.iter_child_nodes(node)
    return found


def modules(path, **options):
    """The modules of this package that a module imports, whole or names of theirs."""
    return {module for full in imports(path, **options) if (module := module_of(full)) is not None}


@cache
def module_of(full):
    """The file of the module that a full name is, or is a name of; None outside the package."""
    parts = full.split(".")
    if parts[0] != "shrm_cli":
        return None
    for end in range(len(parts), 0, -1):
        place = ROOT.joinpath(*parts[:end])
        for path in (place.with_suffix(".py"), place / "__init__.py"):
            if path.exists():
                return path
    raise AssertionError(full)


def is_for_types_only(node):
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    )


def third_party(path, **options):
    tops = {full.split(".")[0] for full in imports(path, **options)}
    return tops - set(sys.stdlib_module_names) - {"shrm_cli"}


def test_there_are_modules():
    assert len(MODULES) > 30
    assert {stop(path) for path in MODULES} >= {"errors", "sphere", "probe", "brdf", "maps", "cli"}


@each_module
def test_imports_point_backwards(path):
    here = stop(path)
    for module in modules(path, nested=here != ""):
        there = stop(module)
        if there not in ("", here):
            assert here, f"shrm_cli/__init__.py imports {name(module)}"
            assert rank(there) < rank(here), f"{name(path)} imports {name(module)}"


def test_no_modules_import_each_other_in_a_circle():
    """Imports within functions, which run later, may close one."""
    graph = {name(path): {name(each) for each in modules(path, nested=False)} for path in MODULES}
    TopologicalSorter(graph).prepare()  # its CycleError names the modules


def test_imports_within_functions_close_no_circle_either():
    """Those for types only do not count, nor the package's own, which are by name."""
    late = {name(path): {name(each) for each in run_time(path)} for path in MODULES}
    late["__init__.py"] = set()
    TopologicalSorter(late).prepare()  # its CycleError names the modules


@each_module
def test_only_some_modules_open_images_or_talk_to_the_terminal(path):
    for used in third_party(path) & USERS.keys():
        assert stop(path) in USERS[used], used


@cache
def declared():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return {line.split(">")[0] for line in project["dependencies"]}


@each_module
def test_only_declared_dependencies_are_imported(path):
    """scipy and ducc0 (GPL) are oracles of the tests alone."""
    extra = EXTRAS.get(name(path), set())
    assert third_party(path) <= declared() | extra
    if stop(path) not in ASKED_FOR:
        assert not extra & third_party(path, nested=False)
        assert not ASKED_FOR & {stop(module) for module in modules(path)}


@pytest.mark.parametrize(
    "path", [path for path in MODULES if stop(path) == "cli" or name(path) in LIGHT], ids=name
)
def test_commands_import_heavy_modules_when_they_run(path):
    """What `shrm --help` would load: the standard library, click, and what is as light."""
    own = {"cli"} & {stop(path)}
    for module in modules(path, nested=False):
        assert stop(module) in own or name(module) in LIGHT, name(module)
    assert third_party(path, nested=False) <= ({"click"} if own else set())


@pytest.mark.parametrize("path", sorted(PACKAGE.glob("*/**/__init__.py")), ids=name)
def test_folders_import_nothing(path):
    """They are loaded with whatever is in them. That of measured BRDFs defines what every
    format in the folder is a subclass of, and that of `shrm_cli.torch` has its public names.
    """
    if name(path) in ("brdf/measured/__init__.py", "torch/__init__.py"):
        return
    assert imports(path) == set()


@pytest.mark.parametrize("representation", REPRESENTATIONS)
def test_every_representation_has_its_modules(representation):
    kind, described = registry.map_class(representation), registry.description(representation)
    assert issubclass(kind, Map)
    assert kind.representation == described.name == representation
    prefilter, file = (registry.module(representation, each) for each in ("prefilter", "file"))
    assert described.title
    assert inspect.signature(file.encode).parameters
    assert list(inspect.signature(file.decode).parameters) == ["file"]
    assert list(inspect.signature(prefilter.report).parameters) == ["result"]
    prints = {option.name for option in described.options if option.prints}
    folder = prefilter.__name__.rpartition(".")[0]
    assert (find_spec(f"{folder}.shader") is not None) == bool(prints)
    assert list(inspect.signature(prefilter.prefilter).parameters) == ["probe", "request"]
    if hasattr(prefilter, "converted"):
        assert list(inspect.signature(prefilter.converted).parameters)[:2] == ["source", "to"]
    assert described.defaults.keys() <= described.arguments


FORM_FOLDERS = {module.partition(".")[0] for module in REPRESENTATIONS.values()}
AMBIGUOUS = {"irradiance", "product", "shrm"}
"""Forms whose names are other words too: only where values are compared they are a form's."""
MAKERS = {"Request", "of", "prefilter", "prefilter_with_facts"}
"""What takes the name of the form that somebody wants a map of."""
ASK_BY_NAME = {
    "vocabulary.py": "the names are defined there",
    "probe/series.py": "irradiance is a quantity, and marks files of maps that are read as light",
    "probe/light_file.py": "irradiance is a quantity, which a lamp is given by",
    "export/make.py": "engines read levels and coefficients, as these two forms hold them",
    "cli/product.py": "it is the command of this form",
}
"""Modules outside of maps/ that name a form or its class otherwise, and why they may."""


@each_module
def test_nothing_asks_for_a_form_by_name(path):
    """Who wants a map of a form names it, as `to`; who has one asks the map and the description of
    its form what they are.
    """
    if stop(path) != "maps":
        found = forms_asked_for(ast.parse(path.read_text()), imports(path))
        assert bool(found) == (name(path) in ASK_BY_NAME), found


def forms_asked_for(tree, imported):
    """The names of forms that a module lists or compares, and their classes in `isinstance`."""
    wanted, compared, classes = set(), set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            wanted |= {id(each.value) for each in node.keywords if each.arg == "to"}
            wanted |= {id(each) for each in node.args if called in MAKERS}
            if called == "isinstance":
                classes |= {each.id for each in ast.walk(node.args[1]) if hasattr(each, "id")}
        elif isinstance(node, ast.Dict):
            pairs = zip(node.keys, node.values, strict=True)
            wanted |= {id(value) for key, value in pairs if getattr(key, "value", "") == "to"}
        elif isinstance(node, ast.Compare):
            compared |= {id(each) for each in ast.walk(node)}
    of_forms = {full.split(".")[-1] for full in imported if FORM_FOLDERS & {*full.split(".")[2:3]}}
    names = {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and node.value in REPRESENTATIONS
        if id(node) not in wanted and (node.value not in AMBIGUOUS or id(node) in compared)
    }
    return names | (classes & of_forms)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("map.representation == 'shrm'", {"shrm"}),
        ("form in ('she', 'irradiance')", {"she", "irradiance"}),
        ("FORMS = 'she', 'product'", {"she"}),
        ("prefilter(probe, to='she')", set()),
        ("Request.of('she', {})", set()),
        ("arguments = {'to': 'she', 'she': 1}", {"she"}),
        ("found['irradiance']", set()),
        ("isinstance(made, Cabral | LightMap)", {"Cabral"}),
        ("Cabral(images)", set()),
    ],
)
def test_the_parser_finds_forms_that_are_asked_for(text, expected):
    imported = {"shrm_cli.maps.explicit.views.Cabral", "shrm_cli.maps.kinds.LightMap"}
    assert forms_asked_for(ast.parse(text), imported) == expected


@each_module
def test_modules_are_small_and_say_what_they_are_for(path):
    assert path.read_text().count("\n") <= MOST_LINES
    assert source(path).docstring


@each_module
def test_files_are_not_trusted(path):
    assert not {full.split(".")[0] for full in imports(path)} & UNTRUSTED_LOADERS
    assert not source(path).calls & {"eval", "exec"}
    assert ("np", "load") not in source(path).attributes


def test_errors_import_nothing():
    assert imports(PACKAGE / "errors.py") == set()


def test_every_error_is_ours():
    """main.py turns the children of ShrmError into one line."""
    tree = ast.parse((PACKAGE / "errors.py").read_text())
    classes = {node.name: [base.id for base in node.bases] for node in tree.body[1:]}
    assert classes.pop("ShrmError") == ["Exception"]
    assert classes.pop("ShrmWarning") == ["UserWarning"]
    assert classes
    assert all(bases == ["ShrmError"] for bases in classes.values())


@pytest.mark.parametrize(
    ("text", "nested", "expected"),
    [
        ("import a.b, c\nfrom d.e import f", False, {"a.b", "c", "d.e.f"}),
        ("def f():\n    from a import b", False, set()),
        ("def f():\n    from a import b", True, {"a.b"}),
        ("if TYPE_CHECKING:\n    import a", False, set()),
        ("if TYPE_CHECKING:\n    import a", True, {"a"}),
        ("try:\n    import a\nexcept ImportError:\n    import b", False, {"a", "b"}),
        ("class C:\n    import a\n    def f(self):\n        import b", False, {"a"}),
    ],
)
def test_the_parser_finds_imports(tmp_path, text, nested, expected):
    (tmp_path / "module.py").write_text(text)
    assert imports(tmp_path / "module.py", nested=nested) == expected
