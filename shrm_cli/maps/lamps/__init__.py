"""Lamps beside a map: discs whose reflection is integrated when the map is used."""
