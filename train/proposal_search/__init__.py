"""Which rules of the proposals reach most objects of labelled drives: all combinations are tried (6.1.4)."""
