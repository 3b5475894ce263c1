"""The command line: `main` lists the commands, each of which is a module of its own."""
