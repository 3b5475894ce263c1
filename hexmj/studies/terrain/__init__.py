"""Real obstacles: steps, gaps, hurdles and rough ground."""
