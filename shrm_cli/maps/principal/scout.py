"""A coarse look at a brushed lobe, which takes long to sample: no map may keep what is asked.

Few azimuths of the view tell nearly what error the best map has, in a tenth of the time. Its share
of wrong pixels is too large then, as its functions have too few waves over the azimuth.
"""

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.brushed_transfer import FEWEST_STEPS, compute_brushed_transfer
from shrm_cli.brdf.cache import remembered
from shrm_cli.maps.principal.brushed import BrushedSpectrum
from shrm_cli.maps.principal.functions import MAX_Q
from shrm_cli.maps.principal.plan import Planner
from shrm_cli.maps.principal.terms import COARSE, Wanted, first_order
from shrm_cli.maps.principal.wrong_share import predicted_wrong_share
from shrm_cli.probe.lighting import Projection
from shrm_cli.reflected import energies_beyond, weighted_power
from shrm_cli.vocabulary import Sampling

_FAR = 1.5, 3.0
"""How many times the error and the share of wrong pixels of the best map must be too large here, to
be so in truth. The shares that were compared were up to 1.6 times those of enough azimuths."""


def is_out_of_reach(light: Projection, brdf: Brdf, want: Wanted, sampling: Sampling) -> bool:
    """Tell whether the best map of a brushed lobe misses what is asked of it by far.

    Parameters
    ----------
    brdf : Brdf
        The only term of a BRDF.
    """
    if brdf.isotropic or want.error is None:
        return False
    order = first_order(brdf)

    def look():  # type: ignore[no-untyped-def]
        return compute_brushed_transfer(brdf, order, MAX_Q, COARSE, FEWEST_STEPS)

    transfer = remembered(brdf, ("scouted", order), look)
    lighting = light.to_order(order)
    spectrum = BrushedSpectrum.of(transfer, brdf.center, weighted_power(lighting, order))
    planner = Planner(spectrum, lighting, sampling)
    form = planner.best_fitting(want.max_size, want.size)
    # What lies at higher degrees is no error of maps that are made of more of them.
    above = energies_beyond(lighting, transfer)[0] * spectrum.visible / max(planner.whole, 1e-300)
    missed = form.total_error**2 - above
    if missed <= COARSE:  # in such a map coarse sampling would tell
        return False
    if missed > (_FAR[0] * want.error) ** 2:
        return True
    if want.seen is None:
        return False
    return predicted_wrong_share([(planner, form)]) > _FAR[1] * want.seen
