"""The process that runs: its threads, the signals that stop it, and how far its work has come."""
