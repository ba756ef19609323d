"""Drawing in the browser: scene, solids, colours, pictures and films."""
