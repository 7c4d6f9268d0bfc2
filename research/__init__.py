"""The tables and figures of the papers that `shrm` implements, made anew with its results."""
