"""The verdict: which effects pass, how sure they are, what cannot be told apart."""
