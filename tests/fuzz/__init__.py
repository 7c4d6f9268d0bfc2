"""The fuzz harness: damaged and lying files, each tried in a process of its own."""
