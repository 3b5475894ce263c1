"""Rivals of the 1998 network from the literature, each in a file of its own; all share what `lifted` says.

Nothing is imported here, so that what was computed with one of them does not depend on the others; `table` lists them.
"""
