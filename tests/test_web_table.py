"""What `make engines` prints and draws of an engine, without the engine."""

import numpy as np
import OpenImageIO as oiio

from tests.web.proofs import Proof, Row
from tests.web.table import HEAD, draw, line


def test_an_engine_has_a_cell_in_every_column():
    rows = [Row("0.2", 0.02, 0.01, 0.03, 40.0), Row("diffuse", 0.1, 0.05, None, 8.0)]
    made = line(Proof("An engine", rows, [], []))
    assert made == "| An engine | x 8 | 5.00 %, 10.0 % |  | 1.00 %, 2.0 % |  |  | 3.0 % |"
    assert {each.count("|") for each in (made, *HEAD.split("\n"))} == {9}


def test_bright_balls_are_not_drawn_white(tmp_path):
    """White metal of roughness 1 under a bright light was a white disc beside a white square."""
    ours = np.full((64, 64, 3), (3.0, 6.0, 4.0))
    draw(tmp_path / "new", Proof("An engine", [], [], [], {"diffuse, white": (ours, ours)}))
    pixels = oiio.ImageBuf(str(tmp_path / "new" / "An-engine-diffuse-white.png")).get_pixels()
    assert pixels.shape == (64, 128, 3)
    balls = pixels[32, [32, 96]]
    assert balls.min() > 0.3
    assert balls.max() < 0.9
    assert (pixels[0, 64] == 0).all()  # ours has a ball alone, too
