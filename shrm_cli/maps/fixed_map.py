"""Maps that have one form only: they are neither converted nor resampled."""

from typing import Any

from shrm_cli.maps.base import Map, no_way, refuse_arguments
from shrm_cli.vocabulary import Sampling


class FixedMap(Map):
    """A map whose file can only be made anew, from the light or from the BRDF."""

    def converted(
        self,
        to: str,
        size: int | None = None,
        sampling: Sampling | None = None,
        **options: Any,
    ) -> Map:
        """Return the map itself, `resampled` where that is asked; it has no other representation.

        Raises
        ------
        ArgumentError
            If another representation is asked for, or an argument does not apply.
        """
        if to != self.representation:
            raise no_way(self, to)
        return super().converted(to, size, sampling, **options)

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> Map:
        """Return the map itself, because what it holds cannot be filtered.

        Raises
        ------
        ArgumentError
            If a size or a sampling is asked for.
        """
        refuse_arguments(self.what, size=size, sampling=sampling)
        return self
