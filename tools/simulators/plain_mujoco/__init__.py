"""Robots that are plain MuJoCo, stepped 10 to 20 times as finely as their files say, with one effect in the model or its log."""
