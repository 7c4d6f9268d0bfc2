"""What prefiltering costs, one probe or a million: measured, fitted, foretold."""
