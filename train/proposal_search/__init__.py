"""Exhaustive search of the proposals' parameters that reach most labelled objects (6.1.4)."""
