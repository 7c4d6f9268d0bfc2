"""Charts: what they show, read from matplotlib's own objects, and the files that they make."""

import struct
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.analysis import plots
from shrm_cli.errors import OutputError
from tests.cli.helpers import process

CAPTURED = np.array([[0.2, 0.3], [0.6, 0.8], [0.7, 0.95], [0.72, 0.985]])
ORDERS = [(2, 1, 0.1), (3, 1, 0.02), (9, 4, 0.001)]
CURVES = {
    "accuracy": np.array([0.3, 0.8, 0.99]),
    "estimate_minimum": np.array([0.2, 0.7, 0.98]),
    "estimate_brdf": np.array([0.2, 0.6, 0.97]),
    "estimate_bound": np.array([0.0, 0.1, 0.9]),
}


@pytest.fixture
def drawn(monkeypatch):
    """The figures in place of their files."""
    figures = []
    monkeypatch.setattr(plots, "_save", lambda figure, path: figures.append(figure))
    return figures


def curves(axes):
    """Lines that have more than one point and are not levels, by label."""
    return {line.get_label(): line.get_ydata() for line in axes.get_lines() if is_curve(line)}


def is_curve(line):
    return not line.get_label().startswith("_")


def chunks(path):
    """Types and contents of a PNG's chunks; their checksums are right."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found, at = [], 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, content = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length])[0] == zlib.crc32(
            kind + content
        )
        found.append((kind, content))
        at += 12 + length
    return found


def test_energies_are_a_curve_for_each_p_with_levels_and_chosen_orders(drawn):
    plots.plot_energy("x.png", CAPTURED, ORDERS, "some brdf")
    captured_axes, missed_axes = drawn[0].axes
    for axes, expected, word in (
        (captured_axes, 100 * CAPTURED, "captured"),
        (missed_axes, 100 - 100 * CAPTURED, "missed"),
    ):
        found = curves(axes)
        assert list(found) == ["0", "1"]
        for p in range(2):
            np.testing.assert_allclose(found[str(p)], expected[:, p])
        assert axes.get_xlabel() == "order F"
        assert axes.get_ylabel() == f"BRDF energy {word} (%)"
        assert axes.get_xlim() == (0, 3)
    assert missed_axes.get_yscale() == "log"
    assert drawn[0].get_suptitle() == "some brdf"
    legend = captured_axes.get_legend()
    assert legend.get_title().get_text() == "P"
    assert [text.get_text() for text in legend.get_texts()] == ["0", "1"]
    names = [text.get_text() for text in missed_axes.texts]
    assert names == ["10%: F = 2, P = 1", "2%: F = 3, P = 1", "0.1%: F = 9, P = 4"]

    def others(axes, marker):
        lines = [line for line in axes.get_lines() if not is_curve(line)]
        return [line for line in lines if (line.get_marker() == "o") == marker]

    assert [line.get_ydata()[0] for line in others(captured_axes, False)] == [90, 98, 99.9]
    np.testing.assert_allclose(
        [line.get_ydata()[0] for line in others(missed_axes, False)], [10, 2, 0.1]
    )
    # Orders outside the grid have no place in it.
    circles = [tuple(np.ravel(line.get_data())) for line in others(captured_axes, True)]
    assert circles == [(2, 95), (3, 98.5)]
    circles = [tuple(np.ravel(line.get_data())) for line in others(missed_axes, True)]
    np.testing.assert_allclose(circles, [(2, 5), (3, 1.5)])
    # All levels are on the logarithmic axis, the lowest above its end.
    low, high = missed_axes.get_ylim()
    assert low < 0.1
    assert high > 100


def test_accuracies_are_figure_5_5(drawn):
    plots.plot_accuracy("x.png", CURVES, 3, "brdf in probe.exr")
    (axes,) = drawn[0].axes
    found = curves(axes)
    assert len(found) == 4
    for (label, values), (key, word) in zip(
        sorted(found.items()),
        [
            ("accuracy", "accuracy of the reflected light"),
            ("estimate_bound", "eq. 5.19"),
            ("estimate_brdf", "error of the BRDF"),
            ("estimate_minimum", "lesser error"),
        ],
        strict=True,
    ):
        assert word in label
        np.testing.assert_array_equal(values, CURVES[key])
    assert axes.get_xlabel() == "order F"
    assert axes.get_ylabel().startswith("accuracy 1 \N{MINUS SIGN} ε")
    assert axes.get_ylim() == (0.5, 1.01)
    assert drawn[0].get_suptitle() == "brdf in probe.exr, P = 3"
    (legend,) = drawn[0].legends
    assert {text.get_text() for text in legend.get_texts()} == set(found)


def test_accuracies_that_stay_low_are_not_cut_off(drawn):
    low = {**CURVES, "estimate_bound": np.array([0.0, 0.01, 0.02])}
    plots.plot_accuracy("x.png", low, 0, "")
    assert drawn[0].axes[0].get_ylim() == (0, 1.01)


@pytest.mark.slow
@pytest.mark.parametrize("captured", [np.ones((33, 1)), np.ones((1, 1)), np.zeros((1, 33))])
def test_degenerate_energies_are_drawn(tmp_path, captured):
    plots.plot_energy(tmp_path / "x.png", captured, [(0, 0, 0.5)], "")
    assert oiio.ImageBuf(str(tmp_path / "x.png")).spec().width > 1000


@pytest.mark.slow
def test_png_tells_whose_it_is_and_nothing_of_time_and_is_the_same_again(tmp_path):
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    plots.plot_energy(a, CAPTURED, ORDERS, "x")
    import matplotlib  # which takes a second to load

    with matplotlib.rc_context({"axes.facecolor": "red", "font.size": 20, "lines.linewidth": 9}):
        plots.plot_energy(b, CAPTURED, ORDERS, "x")
        assert matplotlib.rcParams["font.size"] == 20  # the user's style is left as it was
    assert a.read_bytes() == b.read_bytes()
    assert {kind for kind, _ in chunks(a)} == {b"IHDR", b"pHYs", b"tEXt", b"IDAT", b"IEND"}
    assert [data for kind, data in chunks(a) if kind == b"tEXt"] == [b"Software\0shrm"]
    plots.plot_accuracy(a, CURVES, 0, "x")
    plots.plot_accuracy(b, CURVES, 0, "x")
    assert a.read_bytes() == b.read_bytes()
    assert {kind for kind, _ in chunks(a)} == {b"IHDR", b"pHYs", b"tEXt", b"IDAT", b"IEND"}
    assert [data for kind, data in chunks(a) if kind == b"tEXt"] == [b"Software\0shrm"]
    plots.plot_accuracy(b, CURVES, 1, "x")
    assert a.read_bytes() != b.read_bytes()


@pytest.mark.parametrize("title", ["a $x_ $ b", "x_y^z", "\\frac{", "bytes \udcff.exr", "%s {}"])
def test_any_name_is_a_title(tmp_path, title):
    plots.plot_accuracy(tmp_path / "x.png", CURVES, 0, title)
    assert (tmp_path / "x.png").stat().st_size > 10_000


def test_failed_chart_leaves_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "x.png"
    target.write_bytes(b"old")

    def fail(self, path, **options):
        path.write_bytes(b"half a chart")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fail)
    with pytest.raises(OutputError, match=r"x\.png: cannot be written \(No space left"):
        plots.plot_accuracy(target, CURVES, 0, "")
    assert [path.name for path in tmp_path.iterdir()] == ["x.png"]
    assert target.read_bytes() == b"old"


@pytest.mark.slow
def test_no_window_system_is_asked_for_and_nothing_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLCONFIGDIR", "/dev/null/nowhere")
    code = (
        "import sys, numpy\n"
        "from shrm_cli.analysis import plots\n"
        "assert 'matplotlib' not in sys.modules\n"
        "plots.plot_energy(sys.argv[1], numpy.ones((3, 2)), [], '')\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    result = process(tmp_path / "x.png", code=code)
    assert (result.code, result.out, result.err) == (0, "", "")
    assert (tmp_path / "x.png").exists()


def test_missing_matplotlib_is_noticed(monkeypatch):
    assert plots.can_plot()
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    assert not plots.can_plot()
