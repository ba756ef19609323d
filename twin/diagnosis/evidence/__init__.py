"""What a candidate is worth: first-order patterns, scores, predictions of trials left out."""
