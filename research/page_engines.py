"""The page's part on the maps that engines use: irradiance, split sums and SH exponentials."""

from collections.abc import Callable, Sequence
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from research.exponentials import F0, Contest, Results, geometric_mean, share
from research.irradiance import CLAIMED, PROVEN, IrradianceRow, irradiance_table
from research.page import table
from research.split_sum import SAMPLES, SIZES

Array = NDArray[np.floating]

_PAPER_SHARE = 0.95
"""The part of the paper's 192 cases in which its fit is nearer to the truth than the split sum.

The paper is Silvennoinen et al. 2025.
"""


def irradiance(rows: Sequence[IrradianceRow]) -> str:
    """Write the part on the claim of chapter 4 of Ramamoorthi's thesis."""
    broken = [row for row in rows if not row.keeps_claim]
    bounds = all(row.average < PROVEN[0] and row.maximum < PROVEN[1] for row in rows)
    alike = ""
    if len(rows) > 2:
        pair = [row.degree_4 for row in rows], [row.average for row in rows]
        alike = f"""; over these probes it and the average error go together, with a correlation of
{np.corrcoef(*pair)[0, 1]:.2f}"""
    return _filled(f"""
## Chapter 4: irradiance from nine coefficients

Ramamoorthi and Hanrahan expect average errors below {CLAIMED[0]:.0%} and maxima below
{CLAIMED[1]:.0%} of the light's total intensity. Proven for any light are {PROVEN[0]:.2%} and
{PROVEN[1]:.1%}: those of a single distant light, of which all others are sums. Each row has the
worst channel; "window auto" are the factors of degrees 0 to 2 that keep E from being negative.

{table(*irradiance_table(rows))}
{len(broken)} of {len(rows)} probes break the claim{_reasons(broken)}.
{"All" if bounds else "**Not all**"} stay within the proven bounds.

The claim is one for light from many sides, and a sun or lamps that outshine the rest break it: what
nine coefficients leave out is degree 4 of the light and above (degree 3 of the cosine is 0). Of a
single light, degree 4 is 3 times the mean{alike}.
""")


def exponentials(results: Results, picture: str, pictured: Sequence[str]) -> str:
    """Write the part on the three comparisons of SH exponentials and split sums."""
    cases = results.best[0].front.size
    noisy, filtered = results.paper
    plain, best = results.plain[0], results.best[0]
    more, wide = results.best[1:]
    falls = results.falls
    names, roughnesses = results.names, results.roughnesses
    return _filled(f"""
## SH exponentials and the split sum

Silvennoinen et al. 2025, section 5.1: spheres under {_listed(names)}, with F0 of 1 and .04, and
{len(roughnesses)} alphas r^2, r evenly from {min(roughnesses):g} to {max(roughnesses):g};
{cases} cases. The truth is a sum over all pixels of the
probe, 256 x 128, of GGX with Smith's and Schlick's terms. Numbers are ratios of mean squared errors
over pixels and channels, linear: below 1 the exponential is nearer to the truth. "Front" is the
picture from +Z; "six" compares the mean errors of the pictures from +-X, +-Y and +-Z, as a map
serves all views. Each cell has the share of cases below 1, and the geometric mean of the ratios.

### (a) The paper's fit and the split sum as the paper runs it

The paper's law and fit, 25 + 8 coefficients a channel, alpha from .2 to 1. The split sum has
octahedral maps of {_listed([str(size) for size in SIZES])} texels across, evenly in roughness over
the same range, {SAMPLES} samples a texel chosen by GGX and weighted by N.L (Karis 2013), mixed
between texels and maps, times the environment-BRDF. Samples read the probe of full size, filtered
between its pixels, or, as engines do against noise, mips of it.

{_contests(results.paper, results)}
The paper's fit is nearer to the truth in {_shares(noisy)}; the paper has {_PAPER_SHARE:.0%} of its
own probes and views. It owes that to the noise of {SAMPLES} samples under small suns and lamps:
against samples that read mips it is nearer in {_shares(filtered)}.

### (b) The paper's fit and the exact split sum

The exact one is the strongest split sum that there is: the integral of the lobe for N = V = R, with
Smith's term, at each pixel's R and each roughness, by the code of the truth; no samples, texels or
levels.

{_contests(results.plain, results)}
The paper's fit is nearer to the truth in {_shares(plain)}, with geometric means of
{_means(plain)}. It loses on smooth surfaces, and is ahead for all alphas from
{_ahead_from(plain.front, roughnesses)} on from the front, and from
{_ahead_from(plain.six, roughnesses)} on in six pictures.

### (c) Our fit and the exact split sum

The default: as many coefficients, attenuated by the lobe's own width and centred on its mean
direction, fitted to the light itself. The fit to roughness .2 to 1 begins at alpha .04.

{_contests(results.best, results)}
Our fit is nearer to the truth in {_shares(best)}, with geometric means of {_means(best)}. With
P 6, Q 4 the means are {_means(more)}; a fit that begins at roughness .2 pays for it with
{_means(wide)}.

{_contests([falls], results)}
More coefficients multiply the mean squared error by {_means(falls)}. They gain most on rough
surfaces: each fit is one for all views and roughnesses, and single pictures of smooth spheres may
lose by it.

![spheres: truth, split sum, SHE after the paper, SHE of ours]({picture})

{_listed(pictured)}, with F0 1 on the left and .04 on the right; percentages are relative RMS
errors. The split sum is the exact one. Differences are not amplified; each F0 has its own exposure.
""")


def _contests(contests: Sequence[Contest], results: Results) -> str:
    """Write a table with rows for all cases, and for each f0, alpha and probe."""
    picks: list[tuple[str, Callable[[Array], Array]]] = [("**all**", lambda ratios: ratios)]
    picks += [(f"F0 {f0:g}", lambda ratios, i=i: ratios[i]) for i, f0 in enumerate(F0)]
    picks += [
        (f"alpha {roughness**2:.3f}", lambda ratios, k=k: ratios[:, k])
        for k, roughness in enumerate(results.roughnesses)
    ]
    picks += [(name, lambda ratios, p=p: ratios[:, :, p]) for p, name in enumerate(results.names)]
    head = ["cases"]
    for contest in contests:
        head += [f"{contest.name}: front", "six"]
    body = [
        [label]
        + [_cell(pick(ratios)) for contest in contests for ratios in (contest.front, contest.six)]
        for label, pick in picks
    ]
    return table(head, body)


def _cell(ratios: Array) -> str:
    return f"{share(ratios):.0%}, {geometric_mean(ratios):.2f}"


def _shares(contest: Contest) -> str:
    front, six = share(contest.front), share(contest.six)
    return f"{front:.1%} of the cases from the front and {six:.1%} of those with six pictures"


def _means(contest: Contest) -> str:
    return f"{geometric_mean(contest.front):.3f} and {geometric_mean(contest.six):.3f}"


def _ahead_from(ratios: Array, roughnesses: Sequence[float]) -> str:
    """Find the least alpha from which on all geometric means are below 1."""
    behind = [geometric_mean(ratios[:, k]) >= 1 for k in range(len(roughnesses))]
    first = max((k + 1 for k, each in enumerate(behind) if each), default=0)
    return f"{roughnesses[first] ** 2:.2f}" if first < len(roughnesses) else "none"


def _filled(page: str) -> str:
    """Break paragraphs into lines anew, because the length of their numbers is not known before."""
    blocks = [
        block if block.startswith(("|", "#", "!")) else fill(block, 100)
        for block in page.strip().split("\n\n")
    ]
    return "\n" + "\n\n".join(blocks) + "\n"


def _reasons(rows: Sequence[IrradianceRow]) -> str:
    return ": " + _listed([_reason(row) for row in rows]) if rows else ""


def _reason(row: IrradianceRow) -> str:
    return f"{row.name} ({row.average:.2%} and {row.maximum:.2%}, degree 4 is {row.degree_4:.2f})"


def _listed(words: Sequence[str]) -> str:
    return ", ".join(words[:-1]) + " and " + words[-1] if len(words) > 1 else "".join(words)
