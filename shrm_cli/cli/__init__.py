"""The command line: each subcommand is a file that parses, calls the library and reports."""
