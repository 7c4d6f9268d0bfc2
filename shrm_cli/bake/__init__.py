"""The whole way from a probe and a BRDF to a map."""

from shrm_cli.bake.baked import Baked
from shrm_cli.bake.frequency import bake

__all__ = ["Baked", "bake"]
