"""Benchmarks: `python -m bench`, or one of them by name. Not tests: nothing here passes or fails by a clock.

The one rule: what is printed is a ratio of things measured in the same run wherever that is possible, so that a slow
or busy computer does not make a fast program look slow.
"""
