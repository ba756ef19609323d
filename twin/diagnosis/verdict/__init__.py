"""The verdict: which effects pass, how sure they are, and which cannot be separated."""
