"""What is left, in words, and the experiment that would settle a doubt."""
