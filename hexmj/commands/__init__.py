"""What each command does: call the package, print a table or one JSON object, write the files."""
