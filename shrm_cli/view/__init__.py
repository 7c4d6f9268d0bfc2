"""Pages that show maps in a browser, interactively, without any network."""
