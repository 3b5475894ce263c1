"""The command line of hexmj: `main` lists the commands, and the other modules define them."""
