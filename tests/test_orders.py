"""Orders of the papers' tables, and the errors that they promise."""

import pytest

from shrm_cli import orders as searched
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import OrderError
from shrm_cli.orders import choose_orders


@pytest.mark.parametrize(("sigma", "order_f"), [(0.1, 23), (0.2, 11), (0.3, 7), (0.4, 5), (0.5, 4)])
def test_microfacet_orders_of_table_5_5(sigma, order_f):
    orders, _ = choose_orders(parse_spec(f"microfacet:sigma={sigma}"), 0.03)
    assert abs(orders.order_f - order_f) <= 1
    assert orders.order_p == 2
    assert orders.captured >= 0.97


@pytest.mark.parametrize(
    ("exponent", "order_f"), [(8, 6), (16, 8), (32, 12), (64, 17), (128, 24), (256, 34), (512, 48)]
)
def test_phong_orders_of_equation_5_28(exponent, order_f):
    orders, _ = choose_orders(parse_spec(f"phong:exponent={exponent}"), 0.01)
    assert abs(orders.order_f - order_f) <= 1
    assert orders.order_p == 0


@pytest.mark.parametrize("tolerance", [0.3, 0.05, 0.01])
def test_orders_are_the_least_that_meet_the_tolerance(tolerance):
    brdf = parse_spec("microfacet:sigma=0.35")
    orders, coefficients = choose_orders(brdf, tolerance)
    captured = coefficients.captured
    f, p = orders.order_f, orders.order_p
    assert captured[f, p] >= 1 - tolerance
    assert captured[f - 1, p] < 1 - tolerance
    assert p == 0 or captured[-1, p - 1] < 1 - tolerance


def test_orders_can_be_forced():
    brdf = parse_spec("microfacet")
    orders, coefficients = choose_orders(brdf, 0.03, order_f=40, order_p=10)
    assert (orders.order_f, orders.order_p) == (40, 10)
    assert coefficients.order_f >= 40
    assert coefficients.order_p >= 10
    orders, _ = choose_orders(brdf, 0.03, order_f=0, order_p=0)
    assert (orders.order_f, orders.order_p) == (0, 0)
    assert orders.captured < 0.1
    orders, _ = choose_orders(brdf, 0.03, order_p=0)
    assert orders.order_p == 0
    assert 5 < orders.order_f < 20


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -0.1, 2.0, float("nan"), float("inf")])
def test_tolerance_must_be_a_fraction(tolerance):
    with pytest.raises(OrderError, match="between 0 and 1"):
        choose_orders(parse_spec("phong"), tolerance)


@pytest.mark.parametrize(("order_f", "order_p"), [(513, None), (-1, None), (None, 33), (None, -1)])
def test_forced_orders_have_limits(order_f, order_p):
    with pytest.raises(OrderError, match=r"outside 0 \.\."):
        choose_orders(parse_spec("microfacet"), 0.03, order_f, order_p)


def test_tolerance_that_cannot_be_met_names_what_was_reached():
    # exp(-F^2 / s) at F = 512, s = 1e5 is 0.073 (eq. 5.28).
    with pytest.raises(OrderError, match=r"F = 512 and P = 32; they reach 0\.072"):
        choose_orders(parse_spec("phong:exponent=1e5"), 0.01)


def test_a_p_that_cannot_suffice_is_not_tried(monkeypatch):
    """Each try samples the lobe anew. P = 16 misses 5.6 % of this one, P = 32 misses 3.6 %."""
    tried = []
    computed = searched.coefficients_to

    def recorded(brdf, eps, order_f, order_p):
        tried.append(order_p)
        return computed(brdf, eps, order_f, order_p)

    monkeypatch.setattr(searched, "coefficients_to", recorded)
    choose_orders(parse_spec("ggx:roughness=0.15"), 0.038)
    assert tried == [8, 32]
