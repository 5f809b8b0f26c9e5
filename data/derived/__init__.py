"""Derived labels: which objects move, and which objects the thesis tracks in which frames."""
