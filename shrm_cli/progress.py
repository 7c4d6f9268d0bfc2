"""How work that takes a while tells how far it is."""

from collections.abc import Callable

Progress = Callable[[int, int], object]
"""What is called with the amount of work done so far and the amount in all, in any unit."""
