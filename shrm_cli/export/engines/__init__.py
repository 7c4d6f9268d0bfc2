"""Engines and viewers, one module each; `vocabulary.ENGINES` names them."""
