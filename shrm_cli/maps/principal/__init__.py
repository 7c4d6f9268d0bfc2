"""Maps over the mirror direction times a BRDF's own functions of the view."""
