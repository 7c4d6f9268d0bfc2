"""The tables and figures of the paper's results, made anew with what `shrm` computes."""
