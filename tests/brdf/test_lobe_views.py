"""What the lobes of known views are said to miss."""

import numpy as np

from shrm_cli.brdf.coefficients import ExpandedLobes
from shrm_cli.brdf.lobe_expansion import Views


def _found(value: float, error_theta: float, error_phi: float) -> ExpandedLobes:
    """One lobe with a single coefficient, whose energy is `value`^2 / (2 pi)."""
    values = np.full((1, 1, 1, 1), value)
    errors = np.array([error_theta]), np.array([error_phi])
    return ExpandedLobes(values, values[0, 0] ** 2 / (2 * np.pi), *errors)


def test_a_doubled_rule_errs_no_more_than_its_change_tells() -> None:
    views = Views(np.array([0.5]), np.array([2.0]), (48, 12))
    only = np.array([0])
    views.put(only, _found(1.0, 0.3, 0.2))
    assert views.errors[0].tolist() == [0.3, 0.2]
    views.levels[0] = 96, 12
    views.put(only, _found(1.03, 0.25, 0.4))
    # The rule in theta was doubled: the energy changed by 1.03^2 - 1 over 2 pi, of which a third
    # is missing. That in phi was not, and what it errs was known to be less.
    np.testing.assert_allclose(views.errors[0], [(1.03**2 - 1) / (2 * np.pi) / 3, 0.2])


def test_an_error_is_not_raised_by_a_large_change() -> None:
    views = Views(np.array([0.5]), np.array([2.0]), (48, 12))
    only = np.array([0])
    views.put(only, _found(1.0, 0.3, 0.2))
    views.levels[0] = 96, 24
    views.put(only, _found(5.0, 1e-3, 2e-3))
    assert views.errors[0].tolist() == [1e-3, 2e-3]


def test_a_view_begins_as_the_worse_of_its_neighbors_ended() -> None:
    views = Views(np.array([0.2, 0.4, 0.6]), np.ones(3), (48, 12))
    for view, coarse, fine in ((0, 0.9, 1.0), (2, 0.5, 1.0)):
        at = np.array([view])
        views.levels[view] = 48, 12
        views.put(at, _found(coarse, 9.0, 9.0))
        views.levels[view] = 96, 12 + view
        views.put(at, _found(fine, 9.0, 9.0))
    views.begin_beside(np.array([1]), np.array([0, 2]))
    assert views.levels[1].tolist() == [96, 14]
    views.put(np.array([1]), _found(1.0, 9.0, 9.0))
    # The second neighbor changed more, so that its estimates are worth more.
    np.testing.assert_allclose(views.errors[1], views.errors[[0, 2]].max(axis=0))
    assert views.errors[1, 0] < 0.1
