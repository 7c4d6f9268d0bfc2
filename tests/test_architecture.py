"""The rules of the architecture, held by parsing what each module imports."""

import ast
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from shrm_cli.cli import options
from shrm_cli.maps import light_map, representations

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "shrm_cli"
MODULES = sorted(PACKAGE.rglob("*.py"))

# The stops on the way from a probe to a picture; imports point only to earlier ones, or stay
# within their own. Stops beside each other do not know each other.
STOPS = [
    {"errors", "progress", "settings", "vocabulary"},
    {"layouts"},
    {"sphere"},
    {"files"},
    {"probe", "brdf"},
    {"orders"},
    {"reference"},
    {"maps"},
    {"render"},
    {"analysis"},
    {"cli"},
]
IMAGES = {"OpenImageIO", "OpenEXR"}
TERMINAL = {"click", "tqdm"}
MAY_READ_IMAGES = {"brdf/measured/reading/table_file.py", "probe/image_file.py"}
EXTRAS = {
    "analysis/plots.py": {"matplotlib"},
    "brdf/measured/reading/spectrum.py": {"colour"},
}
"""What belongs to an extra, and is imported where it is used."""
LIGHT = {"cli", "errors", "files", "layouts", "settings", "vocabulary", "__version__"}
"""Stops that `shrm --help` may load."""
UNTRUSTED_LOADERS = {"pickle", "marshal", "shelve", "dill", "joblib"}
MOST_LINES = 320


def name(path):
    return path.relative_to(PACKAGE).as_posix()


def stop(path):
    """The stop that a module belongs to: its folder, or itself; "" for the package's own."""
    first = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return "" if first == "__init__" else first


def rank(of):
    for index, stops in enumerate(STOPS):
        if of in stops:
            return index
    raise AssertionError(f"{of} has no place in the architecture; give it one in STOPS")


@cache
def imports(path, nested=True):
    """Full names that a module imports, as "a.b.c"; without nested ones only at its top level."""
    tree = ast.parse(path.read_text())
    found = set()
    pending = list(ast.iter_child_nodes(tree))
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif is_for_types_only(node) and not nested:
            continue
        elif nested or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            pending += ast.iter_child_nodes(node)
    return found


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


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_imports_point_backwards(path):
    here = stop(path)
    for full in imports(path):
        top, _, rest = full.partition(".")
        there = rest.split(".")[0]
        if top != "shrm_cli" or there in ("", "__version__", here):
            continue
        assert here, f"shrm_cli/__init__.py imports {full}"
        assert rank(there) < rank(here), f"{name(path)} imports {full}"


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_only_some_modules_open_images_or_talk_to_the_terminal(path):
    used = third_party(path)
    if name(path) not in MAY_READ_IMAGES and stop(path) != "files":
        assert not used & IMAGES
    if stop(path) != "cli":
        assert not used & TERMINAL


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_only_declared_dependencies_are_imported(path):
    """scipy and ducc0 (GPL) are oracles of the tests alone."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = {line.split(">")[0] for line in project["dependencies"]}
    extra = EXTRAS.get(name(path), set())
    assert third_party(path) <= declared | extra
    assert not extra & third_party(path, nested=False)


@pytest.mark.parametrize("path", [path for path in MODULES if stop(path) == "cli"], ids=name)
def test_commands_import_heavy_modules_when_they_run(path):
    """What `shrm --help` would load: the standard library, click, and what is as light."""
    for full in imports(path, nested=False):
        top, _, rest = full.partition(".")
        if top == "shrm_cli":
            assert rest.split(".")[0] in LIGHT, full
        else:
            assert top == "click" or top in sys.stdlib_module_names, full


def test_commands_name_the_representations_that_there_are():
    """cli/options.py repeats their names, since `shrm --help` must not load the maps."""
    assert options.REPRESENTATIONS == representations.REPRESENTATIONS
    assert options.ENGINE_REPRESENTATIONS == light_map.ENGINES


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_modules_are_small_and_say_what_they_are_for(path):
    text = path.read_text()
    assert text.count("\n") < MOST_LINES
    assert ast.get_docstring(ast.parse(text))


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_files_are_not_trusted(path):
    assert not {full.split(".")[0] for full in imports(path)} & UNTRUSTED_LOADERS
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in ("eval", "exec")
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert (node.value.id, node.attr) != ("np", "load")


def test_errors_import_nothing():
    assert imports(PACKAGE / "errors.py") == set()


def test_every_error_is_ours():
    """main.py turns the children of ShrmError into one line."""
    tree = ast.parse((PACKAGE / "errors.py").read_text())
    classes = {node.name: [base.id for base in node.bases] for node in tree.body[1:]}
    assert classes.pop("ShrmError") == ["Exception"]
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
