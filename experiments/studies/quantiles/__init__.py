"""Which quantile of a frame suits best: stated from its light, then looked for."""
