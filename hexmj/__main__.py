"""`python -m hexmj` is the command `hexmj`."""

from hexmj.cli.main import main

main()
