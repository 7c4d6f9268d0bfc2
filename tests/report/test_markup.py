"""The HTML that pages are put together of."""

from shrm_cli.report.markup import spec


def test_specifications_break_after_commas_and_are_escaped():
    assert spec("ggx:f0=gold,roughness=0.3") == "<code>ggx:f0=gold,<wbr>roughness=0.3</code>"
    assert spec("<b>,x") == "<code>&lt;b&gt;,<wbr>x</code>"
    assert spec("lambertian") == "<code>lambertian</code>"
