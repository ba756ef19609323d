"""The evidence of a candidate: first-order patterns, scores, predictions of left-out trials."""
