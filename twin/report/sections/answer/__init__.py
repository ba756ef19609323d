"""Sections with the answer: errors before and after, effects, remaining error, next experiment."""
