"""Files that game engines and viewers load, made from probes and maps."""
