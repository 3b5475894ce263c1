"""`python -m hexmj` is the command `hexmj`."""

from hexmj.cli import main

main()
