"""The thresholds by which maps are chosen, each with what it was measured by.

A threshold that no test notices when it is changed does not belong here.
"""

TRIED_DARK = 3
"""How many maps are made, each with less error than the one before, because something visible is
negative in the last. Where a third one is dark, too, so is one of 32 MB: a lamp in a sharp lobe."""

# ---- the search ----------------------------------------------------------------------------------

FINER = 2**-0.5
"""The ratio of the errors that are tried one after the other, until what is seen is good. The bytes
of glossy maps double with each, so that hardly half of them can be too many."""
CLOSE = 2**0.125
"""The least ratio of the first two errors that are tried, where the first map nearly keeps what is
asked."""
SPARED = 2**17
"""The bytes of a map that keeps what is asked up to which none of fewer bytes is looked for among
maps of all errors. That takes about a second of sharp lobes, and of 72 glossy maps under real
probes, half of which took other cubes, it saved no more than some ten kilobytes of smaller ones."""
LEAST_ERROR = 0.001
"""The least error that is tried. Between soft boxes, where next to nothing is lit, pixels are wrong
of maps that miss .4 % of all light: of hair 11 % in .2 MB, and 1 % in .3 MB."""
SIMPLE_TIMES = 4
"""An SHRM that keeps what is asked is taken where it has at most so many times the bytes of the map
of principal functions, and a P of at most `SIMPLE_ORDER_P`: its shader is the shortest, and readers
of other programs know it. Both are some kilobytes there."""
SIMPLE_ORDER_P = 4
"""The largest P of SHRMs that are taken: 25 coefficients, about as many look-ups as the principal
maps of the same errors have. Under a sunset GGX of roughness .5 keeps what is asked with P = 11, of
144 coefficients and 746 kB; eleven cubes of principal functions do, in 69 kB."""
NEARLY_AS_GOOD = 1.1
"""How many times the least error a map of fewer cubes may have, as shaders look up every cube."""
NEARLY_BEST = 1.05
"""How many times the least error a smaller map may have, where no map meets the tolerance."""
NEAR = 0.6
"""Maps of this part of the bytes that halving found, and more, are looked at one by one, until none
of fewer bytes is found. Halving took up to twice the bytes, and too many for 128 of 2888 pairs of
an error and a lobe: ten materials under eight probes, from 30 % to 1 %. This is never wrong there
and looks at 27 maps; .7 is wrong twice and looks at 23, halving at 13, and there are 160."""
NEARLY_KEPT = 1.5
"""How many times the error the largest map of fewer bytes of a size may have, for others of the
size to be looked at. With 1.3 the search is wrong three times, and looks at 24 maps."""
TRIES = 3
"""How often forms are sought that keep an error with their tables, whose error searches leave out:
the error that is asked for falls each time by how much it was missed."""
WORTH_LAMPS = 0.5
"""Where no map keeps what is asked, lamps are put beside one that does, or that misses less in at
most this part of the bytes. Plastic at night misses 5.15 % (RMS) so, in 18 kB, and 8.4 % in 18.7 MB
with the lamps in the map. Soft boxes in a coat of roughness .1 miss about as much as discs, in half
of the bytes, and stay what they are: programs that know no lamps beside a map show none at all."""
FAR_LESS_WRONG = 0.5
"""The part of what the best map of all light misses, at most, for which lamps are put beside one of
any bytes. Brushed copper has 84 % wrong pixels in a room with a strip of light along its ceiling,
and 10 % in 14 MB beside it."""
FAR_SMALLER = 0.1
"""The part of the bytes for which lamps are put beside a map of more than `LARGE` bytes. They are,
too, where no map keeps what is asked, beside one that misses up to `MISSED` times as much. Of half
a city over black ground, gold of roughness .4 has 7.4 % wrong pixels in 20.8 MB, and 8.1 % in .7 MB
beside its sun."""
LARGE = 2**22
"""The bytes of a map that keeps what is asked above which one with lamps beside it is looked for,
which is taken if it keeps that, too, and is `FAR_SMALLER`. Under a city of one sun GGX of roughness
.3 took 12.1 MB so, and takes .13 MB beside the sun; that of roughness .25 keeps nothing with the
sun in the map. The second search takes about as long as the first one."""
BESIDE = 0.9
"""The most that lamps beside a map may take of the error that is asked for: the map keeps what is
left of it, at least .44. What discs change is held by the map as far as they would take more."""
WRONG_BESIDE = 0.5
"""The most that lamps beside a map may take of the share of wrong pixels that is asked for, before
the map holds some of what discs change. What the map misses comes on top of it. A strip of weak
light along a ceiling is 2 % of the light beside a bright window, and eight discs in its place made
12 % of the pixels of GGX of roughness .4 wrong."""
MISSED = 1.1
"""How many times the least share of wrong pixels a smaller map may have, where no map keeps what is
asked: the last megabytes of a lamp in a sharp lobe change little that is seen."""

# ---- what a tolerance makes ----------------------------------------------------------------------

LEAST_BYTES = 2**17
"""Bytes that a principal map may have whatever the tolerance is. Broad lobes need so few texels
that only a handful of functions would be left, and dark places a third wrong."""
FAIRLY = 1.25
"""How many times the known degrees cubes may support that are compared with smaller ones. Cubes of
64, 128 and 256 texels support just so many times the 64, 128 and 256 degrees that are tried."""
LOOSER = tuple(2.0 ** (step / 4) for step in range(24, -5, -1))
"""The tolerances that are tried for the terms of a sum, in units of the whole BRDF's: from 64,
where the light hardly changes, to a half, where each term is sharper than the whole."""
LARGEST_TOLERANCE = 0.7
"""The largest tolerance that is tried for the terms."""
NO_ERROR = 1e-6
"""The error that the orders of terms may always have. Under constant light those of all orders are
about 1e-8, the root of what double precision leaves, which differs from processor to processor."""
