"""The command line: `commands` lists the commands, each of which is a module of its own."""
