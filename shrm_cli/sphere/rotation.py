"""Rotating the coefficients of functions on the sphere.

Turns about z only mix the harmonics +m and -m of a degree, in pairs. Every other rotation is made
of them and of one fixed rotation, a quarter turn, whose matrices are kept: the work for many points
is then a few turns of pairs, and two products with matrices that are the same for all of them.
"""

import threading
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, Indices, Memo, kept_order
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import degrees, degrees_and_orders, order_of
from shrm_cli.sphere.wigner import KEPT_ORDER, right_angle_degrees, right_angle_rows, shared_order

_REPEATED_ORDER = 64
_known_blocks = Memo(2**24)
"""The matrices of rotations that are needed again and again. Those of order 64 take 3 MB."""
_BLOCK = 8192
"""Values of each m that are turned at a time, few enough to stay in the processor's cache."""
_SMALL = 1e-3
"""The part of a light below which a direction of it is none, as that of even light."""
_DIRECT = 2
"""The largest degree whose rotations are written as polynomials of the matrix elements."""

_LINEAR = np.eye(3)[[1, 2, 0]]
"""``Y_1m`` is proportional to ``_LINEAR[m + 1] . d``: y, z and x."""
_QUADRATIC = np.zeros((5, 3, 3))
"""``Y_2m`` is proportional to ``d . _QUADRATIC[m + 2] . d``; these are orthonormal matrices."""
for _at, _i, _j in ((0, 0, 1), (1, 1, 2), (3, 0, 2)):
    _QUADRATIC[_at, _i, _j] = _QUADRATIC[_at, _j, _i] = np.sqrt(1 / 2)
_QUADRATIC[2] = np.diag([-1.0, -1.0, 2.0]) / np.sqrt(6)
_QUADRATIC[4] = np.diag([1.0, -1.0, 0.0]) / np.sqrt(2)


def euler_zyz(rotations: ArrayLike) -> tuple[Array, Array, Array]:
    """Angles (a, b, c) of ``rotation = Rz(a) Ry(b) Rz(c)``.

    `rotations` are of shape (..., 3, 3).

    Returns `a`, `b` and `c`, each of shape (...), radians; b is in [0, pi].
    """
    r = np.asarray(rotations, dtype=float)
    first, second, third = np.moveaxis(r, -2, 0)
    alpha = np.arctan2(second[..., 2], first[..., 2])
    cosine, sine = np.cos(alpha)[..., None], np.sin(alpha)[..., None]
    # With a taken out, the rows of Ry(b) Rz(c) give b and c. Near b = 0 and b = pi, where a is
    # noise, c makes up for it.
    x = cosine * first + sine * second
    y = cosine * second - sine * first
    return alpha, np.arctan2(x[..., 2], third[..., 2]), np.arctan2(y[..., 0], y[..., 1])


def transform_coefficients(coefficients: ArrayLike, matrix: ArrayLike) -> Array:
    """Coefficients of ``g(d) = f(M^-1 d)``, f carried along by M, shape ((order+1)^2, ...).

    `coefficients`, of shape ((order+1)^2, ...), are real coefficients of f, index l(l+1)+m.
    `matrix`, of shape (3, 3), is the orthogonal matrix M: a rotation, or a rotation with a
    mirroring.
    """
    source, matrix = np.asarray(coefficients, dtype=float), np.asarray(matrix, dtype=float)
    flat = source.reshape(len(source), -1)
    if np.linalg.det(matrix) < 0:
        matrix = matrix * [1.0, -1.0, 1.0]
        flat = flat * np.where(_is_sine(len(flat)), -1.0, 1.0)[:, None]
    return _turned_once(flat, euler_zyz(matrix)).reshape(source.shape)


def own_axes(light: Array) -> Array:
    """Return the rotation to axes that turn with a light, (3, 3).

    What samples of a light decide turns with it where the samples are in these axes. The first is
    that of degree 1, v, and the second lies in the plane of v and Q v, where Q is the tensor of
    degree 2. Light without such directions stays as it is.

    `light`, of shape (n,), holds coefficients in world axes, index l(l+1)+m.
    """
    if len(light) < len(degrees(2)):
        return np.eye(3)
    xy, yz, zz, xz, square = light[4:9] * [1, 1, 1 / np.sqrt(3), 1, 1]
    tensor = np.array([[square - zz, xy, xz], [xy, -square - zz, yz], [xz, yz, 2 * zz]])
    first = light[[3, 1, 2]]
    third = np.cross(first, tensor @ first)
    least = _SMALL * float(np.linalg.norm(light))
    if np.linalg.norm(first) <= least or np.linalg.norm(third) <= least**3:
        return np.eye(3)
    axes = np.array([first, np.cross(third, first), third])
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))


def rotated_again(coefficients: Array, rotation: Array) -> Array:
    """Return what `transform_coefficients` does, faster for a rotation that is needed again.

    Its matrices are kept, up to an order, and so sums are rounded differently.

    `coefficients` are of shape ((order+1)^2, maps). `rotation` is of shape (3, 3).
    """
    order = order_of(len(coefficients))
    if order > _REPEATED_ORDER:
        return transform_coefficients(coefficients, rotation)
    kept = kept_order(order)
    blocks = _known_blocks.get((kept, rotation.tobytes()), lambda: rotation_blocks(kept, rotation))
    result = np.empty_like(coefficients)
    for degree, block in enumerate(blocks[: order + 1]):
        rows = slice(degree**2, (degree + 1) ** 2)
        np.matmul(block, coefficients[rows], out=result[rows])
    return result


def rotation_blocks(order: int, rotation: Array) -> list[Array]:
    """Return the matrix of a rotation between the harmonics of each degree; see `_turn_zyz`."""
    alpha, beta, gamma = euler_zyz(rotation)
    exchanged = bool(beta == np.pi / 2)
    quarter = 0.0 if exchanged else np.pi / 2
    # To multiply with a turn from the right is to turn the transposed matrix the other way.
    back, between, after = (
        _phases(order, np.array([each])) for each in (-gamma - quarter, beta, alpha - quarter)
    )
    is_known = order <= KEPT_ORDER
    blocks = []
    for quarter_turn in _known_turns.up_to(order) if is_known else _right_angle_turns(order):
        matrix = quarter_turn.matrix
        block = _turned(matrix.T, back).T
        if not exchanged:
            block = matrix.T @ _turned(block, between)
        blocks.append(np.array(_turned(block, after)))
    return blocks


def rotate_into_frames(coefficients: ArrayLike, frames: ArrayLike) -> Array:
    """Turn one set of functions of direction, in world axes, into many local frames.

    `coefficients`, of shape ((order+1)^2, ...), are real coefficients of the functions, index
    l(l+1)+m. `frames`, of shape (points, 3, 3), are orthogonal. The rows of each are the axes x',
    y', z' of a local frame in world axes, so that ``frame @ world = local``.

    Returns an array of shape ((order+1)^2, ..., points).

    References: Kautz, Sloan & Snyder 2002, Fast, Arbitrary BRDF Shading for Low-Frequency Lighting
    Using Spherical Harmonics, appendix: low degrees are polynomials of the matrix elements, of
    which the products with the coefficients are taken once for all points; higher ones are turned
    by Euler angles. Degrees 0 to 2 are four times as fast by polynomials.
    """
    source, frames = np.asarray(coefficients, dtype=float), np.asarray(frames, dtype=float)
    result = np.empty((*source.shape, len(frames)))
    order = order_of(len(source))
    direct = min(order, _DIRECT)
    _polynomials(source[: (direct + 1) ** 2], frames, result)
    if order > direct:
        each = np.broadcast_to(source[..., None], result.shape)
        _turn_into_frames(each, frames, result, direct + 1)
    return result


def rotate_each_into_frames(coefficients: ArrayLike, frames: ArrayLike) -> Array:
    """Turn functions of direction, one of each point, into the local frames of the points.

    `coefficients`, of shape ((order+1)^2, ..., points), are in world axes, and `frames` are those
    of `rotate_into_frames`. The result has the shape of the coefficients.
    """
    source = np.asarray(coefficients, dtype=float)
    result = np.empty_like(source)
    _turn_into_frames(source, np.asarray(frames, dtype=float), result)
    return result


def rotate_to_frames(
    coefficients: ArrayLike, theta: ArrayLike, phi: ArrayLike, inverse: bool = False
) -> Array:
    """Turn functions in world axes into each point's own local frame, of the same shape.

    `coefficients`, of shape ((order+1)^2, ..., points), are a function of direction at each point,
    in world axes. `theta` and `phi`, each of shape (points,), are angles of the frames' z axes,
    radians; the frames are those of `local_frame`. `inverse` turns functions in the local frames
    into world axes instead.

    References: Ramamoorthi 2002, eq. 5.13 and 5.14; the inverse is what they do.
    """
    source = np.asarray(coefficients)
    result = np.empty_like(source)
    points = source.shape[-1:]
    theta, phi = np.broadcast_to(theta, points), np.broadcast_to(phi, points)
    none = np.zeros(points)
    _turn_zyz(source, (phi, theta, none) if inverse else (none, -theta, -phi), result)
    return result


def turn_about_z(coefficients: ArrayLike, angle: ArrayLike) -> Array:
    """Rotate coefficients about +Z, f(phi) to f(phi - angle).

    `coefficients`, of shape ((order+1)^2, ...), are real coefficients, index l(l+1)+m. `angle`,
    which broadcasts with the last axes of `coefficients`, is in radians.

    Returns an array of shape ((order+1)^2, ...): the last axes are those that both broadcast to.
    """
    values = np.asarray(coefficients, dtype=float)
    phases = _phases(order_of(len(values)), np.asarray(angle, dtype=float))
    blocks = [
        _turned(values[degree**2 : (degree + 1) ** 2], phases)
        for degree in range(order_of(len(values)) + 1)
    ]
    return np.concatenate(blocks)


def _polynomials(source: Array, frames: Array, result: Array) -> None:
    """Write the degrees 0 to 2 of the functions in each frame, as `rotate_into_frames` has it.

    With ``f(d) = sum_n c_n (a_n . d)`` the function in the frame F is ``sum_n c_n (F a_n) . d``,
    and likewise ``d . (F S F^T) d`` where f is ``d . S d``.
    """
    shape = source.shape[1:]
    flat, points = source.reshape(len(source), -1), len(frames)
    elements = np.ascontiguousarray(frames.reshape(points, 9).T)
    result[0] = source[0, ..., None]
    if len(source) > 1:
        linear = np.einsum("mi,na,nc->mcia", _LINEAR, _LINEAR, flat[1:4]).reshape(-1, 9)
        result[1:4] = (linear @ elements).reshape(3, *shape, points)
    if len(source) > 4:
        forms = np.einsum("nab,nc->cab", _QUADRATIC, flat[4:9])
        weights = np.einsum("mij,cab->mciajb", _QUADRATIC, forms).reshape(-1, 9, 9)
        # Only one of the two products of a pair of different elements is made.
        first, second = np.triu_indices(9)
        pairs = (weights + weights.swapaxes(1, 2))[:, first, second]
        pairs *= np.where(first == second, 0.5, 1.0)
        for at in range(0, points, _BLOCK):
            part = elements[:, at : at + _BLOCK]
            product = pairs @ (part[first] * part[second])
            result[4:9, ..., at : at + _BLOCK] = product.reshape(5, *shape, -1)


def _turn_into_frames(source: Array, frames: Array, result: Array, lowest: int = 0) -> None:
    """Write functions, shape ((order+1)^2, ..., points), in a frame of their own each.

    Degrees below `lowest` are left as they are in the result.
    """
    mirrored = np.linalg.det(frames) < 0
    if mirrored.any():  # y -> -y comes first: the sine harmonics change sign
        frames = np.where(mirrored[:, None, None], frames * [1.0, -1.0, 1.0], frames)
        sign = np.where(_is_sine(len(source))[:, None] & mirrored, -1.0, 1.0)
        source = source * sign.reshape(len(source), *[1] * (source.ndim - 2), -1)
    _turn_zyz(source, euler_zyz(frames), result, lowest)


def _is_sine(count: int) -> NDArray[np.bool_]:
    """Tell which of so many harmonics have m < 0, and so a sine of the longitude."""
    degree = degrees(order_of(count))
    return np.asarray(np.arange(count) < degree * (degree + 1))


def _turned_once(flat: Array, angles: tuple[Array, Array, Array]) -> Array:
    """Return functions, shape ((order+1)^2, maps), carried along by one rotation.

    It is what `_turn_zyz` does for a single point, for all degrees at once, because single degrees
    are too small to be worth a call each.
    """
    order = order_of(len(flat))
    alpha, beta, gamma = angles
    degree, m = _known_indices.get(order, lambda: degrees_and_orders(order))
    mirrored = degree * (degree + 1) - m

    def turned(values: Array, angle: Array) -> Array:
        phase = np.arange(order + 1) * angle
        cosine, sine = np.cos(phase)[np.abs(m)], (np.sign(m) * np.sin(phase)[np.abs(m)])
        return cosine[:, None] * values - sine[:, None] * values[mirrored]

    def product(values: Array, is_back: bool) -> Array:
        if order <= KEPT_ORDER:
            return _quarter_turned(values, degree, m, is_back)
        result = np.empty_like(values)
        for each, quarter_turn in enumerate(_quarter_turns(order)):
            rows = slice(each**2, (each + 1) ** 2)
            result[rows] = quarter_turn.applied(values[rows], is_back)
        return result

    if beta == np.pi / 2:
        return turned(product(turned(flat, gamma), False), alpha)
    flat = product(turned(flat, gamma + np.pi / 2), False)
    return turned(product(turned(flat, beta), True), alpha - np.pi / 2)


def _quarter_turned(values: Array, degree: Indices, m: Indices, is_back: bool) -> Array:
    """Turn functions by Ry(pi/2), or back, by the rows that all degrees share; see `_SplitTurn`.

    `values`, of shape (n, maps), are coefficients of degrees and orders, each of shape (n,).
    """
    order, is_sine, n = int(degree[-1]), (m < 0).astype(int), np.abs(m)
    weights = _turn_weights(order)
    if is_back:
        weights = np.abs(weights)
    weighted = weights[n, None] * values
    split = np.zeros((order + 1, order + 1, 2, 2, values.shape[1]))
    split[degree, n, n % 2, is_sine] = weighted
    rows = right_angle_rows(shared_order(order))[: order + 1, : order + 1, : order + 1]
    turned = (rows.swapaxes(0, 1) @ split.reshape(order + 1, order + 1, -1)).reshape(split.shape)
    above = degree - n
    return np.asarray(weights[n, None] * turned[degree, above, (above + is_sine) % 2, is_sine])


_known_indices = Memo(2**20)
"""Degrees and orders; those up to degree 128 take a quarter of a megabyte."""


def _turn_zyz(
    source: Array, angles: tuple[Array, Array, Array], result: Array, lowest: int = 0
) -> None:
    """Carry functions along by ``Rz(a) Ry(b) Rz(c)`` of their own each.

    ``Ry(b) = Rx(-90) Rz(b) Rx(90)``, and ``Rx(90) = Rz(-90) Ry(90) Rz(90)``, degrees, whose turns
    about z join those by a and c. Where b is 90 degrees itself, as where axes are exchanged for
    lat-longs and cubes, a single product with the matrices of ``Ry(90)`` does.

    `source` is of shape ((order+1)^2, ..., points). `angles`, each of shape (points,), are the
    three angles, radians. `result`, of the shape of `source`, is what is written. Degrees below
    `lowest` are not written.

    References: Ramamoorthi 2002, eq. 2.29, for the convention: ``D^l_mn(a, b, c) = exp(-i m a)
    d^l_mn(b) exp(-i n c)``, here between real harmonics.
    """
    order = order_of(len(source))
    alpha, beta, gamma = angles
    exchanged = bool((beta == np.pi / 2).all())
    quarter = 0.0 if exchanged else np.pi / 2
    about_z = gamma + quarter, beta, alpha - quarter
    # Three turns and two products of single precision would lose a digit, so blocks are double.
    turns = [_phases(order, each) for each in about_z]
    points = source.shape[-1]
    step = max(_BLOCK * points // max(source[0].size, 1), 1)
    for degree, quarter_turn in enumerate(_quarter_turns(order)):
        if degree < lowest:
            continue
        rows = slice(degree**2, (degree + 1) ** 2)
        for at in range(0, points, step):
            some = np.s_[..., at : at + step]
            before, between, after = ((cosine[some], sine[some]) for cosine, sine in turns)
            block = source[rows][some].astype(float, copy=False)
            block = quarter_turn.applied(_turned(block, before))
            if not exchanged:
                block = quarter_turn.applied(_turned(block, between), backwards=True)
            result[rows][some] = _turned(block, after)


def _phases(order: int, angle: Array) -> tuple[Array, Array]:
    """Cosines and sines of m times angles, m = 1 .. order, shape (order, ...) each."""
    phase = np.arange(1, order + 1).reshape(-1, *[1] * angle.ndim) * angle
    return np.cos(phase), np.sin(phase)


def _turned(block: Array, phases: tuple[Array, Array]) -> Array:
    """Functions of one degree, shape (2l+1, ...), turned about +Z by angles as `_phases` has them.

    The angles broadcast with the last axes of the functions.
    """
    degree = len(block) // 2
    if degree == 0:
        return np.broadcast_to(block, np.broadcast_shapes(block.shape, (1, *phases[0].shape[1:])))
    missing = [1] * (block.ndim - phases[0].ndim)
    cosine, sine = (each[:degree].reshape(degree, *missing, *each.shape[1:]) for each in phases)
    plus, minus = block[degree + 1 :], block[degree - 1 :: -1]
    shape = np.broadcast_shapes(plus.shape, cosine.shape)
    result = np.empty((2 * degree + 1, *shape[1:]), dtype=block.dtype)
    result[degree] = block[degree]
    result[degree + 1 :] = cosine * plus - sine * minus
    result[degree - 1 :: -1] = cosine * minus + sine * plus
    return result


@record(eq=False)
class _WholeTurn:
    """The matrix of Ry(pi/2) between real harmonics of one degree: one product for few of them."""

    matrix: Array

    def applied(self, block: Array, backwards: bool = False) -> Array:
        """Turn functions, shape (2l+1, ...), or turn them back."""
        matrix = self.matrix.T if backwards else self.matrix
        return np.asarray(matrix @ block.reshape(len(block), -1)).reshape(block.shape)


@record(eq=False)
class _SplitTurn:
    """The same by the parts of that matrix that are not zero, a quarter of it."""

    blocks: list[list[Array]]
    """``blocks[i][j]`` has the ``d_mn`` of m = i, i + 2 .. and n = j, j + 2 .."""
    weights: Array
    """The factors between ``d_mn`` and real harmonics, of m and of n alike, shape (l+1, 1)."""

    def applied(self, block: Array, backwards: bool = False) -> Array:
        degree = len(block) // 2
        flat = block.reshape(len(block), -1)
        result = np.empty_like(flat)
        # The matrix of the turn back has no sign (-1)^(m+n).
        weights = np.abs(self.weights) if backwards else self.weights
        # Both halves hold m = 0, which is a cosine: there are no sines to come from it, and the
        # cosines come last.
        for is_sine, half in ((1, np.s_[degree::-1]), (0, np.s_[degree:])):
            source, target = weights * flat[half], result[half]
            source[:is_sine] = 0
            for i in (0, 1):
                # Cosine harmonics meet where l + m + n is even, sine harmonics where it is odd.
                j = (degree + i + is_sine) % 2
                target[i::2] = self.blocks[i][j] @ source[j::2]
            target *= weights
        return result.reshape(block.shape)


def _quarter_turns(order: int) -> Iterable[_WholeTurn | _SplitTurn]:
    """Yield Ry(pi/2) between real harmonics, degree by degree."""
    if order <= KEPT_ORDER:
        return _known_turns.up_to(order)
    weights = _turn_weights(order)[:, None]
    return (
        _SplitTurn(
            [[np.ascontiguousarray(each[i::2, j::2]) for j in (0, 1)] for i in (0, 1)],
            weights[: len(each)],
        )
        for each in right_angle_degrees(order)
    )


def _turn_weights(order: int) -> Array:
    """The factors of m or n between ``d_mn`` and real harmonics, shape (order+1,)."""
    m = np.arange(order + 1)
    return np.where(m == 0, 1.0, np.sqrt(2)) * (-1.0) ** m


def _right_angle_turns(order: int, first: int = 0) -> Iterator[_WholeTurn]:
    """Yield the matrices of Ry(pi/2) from ``d_mn``, m, n >= 0, by ``d_m,-n = (-1)^(l+m) d_mn``.

    The degrees are `first` .. `order`. Cosine harmonics meet where l + m + n is even, sine
    harmonics where it is odd.
    """
    m = np.arange(order + 1)
    factor = _turn_weights(order)
    weights = factor[:, None] * factor
    odd = (m[:, None] + m) % 2
    by_parity = weights * (1 - odd), weights * odd
    for degree, quadrant in enumerate(right_angle_degrees(order, first), first):
        size = degree + 1
        cosine, sine = by_parity[degree % 2], by_parity[1 - degree % 2]
        result = np.zeros((2 * degree + 1, 2 * degree + 1))
        np.multiply(quadrant, cosine[:size, :size], out=result[degree:, degree:])
        np.multiply(
            quadrant[:0:-1, :0:-1], sine[degree:0:-1, degree:0:-1], out=result[:degree, :degree]
        )
        yield _WholeTurn(result)


class _KnownTurns:
    """The matrices of `_right_angle_turns`, which are the same for all orders; kept for good.

    Those of higher degrees are added when they are first asked for.
    """

    def __init__(self) -> None:
        self._found: list[_WholeTurn] = []
        self._lock = threading.Lock()

    def up_to(self, order: int) -> list[_WholeTurn]:
        with self._lock:
            if order >= len(self._found):
                self._found += _right_angle_turns(shared_order(order), len(self._found))
        return self._found[: order + 1]


_known_turns = _KnownTurns()
