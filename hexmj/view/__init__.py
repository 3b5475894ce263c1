"""Walks looked at while they go: one insect, a controller that may change, MuJoCo's viewer or a browser."""
