"""The league: controllers judged by the same starts on paper and in physics."""
