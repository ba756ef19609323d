"""What is left, in words, and the experiment that would separate ambiguous candidates."""
