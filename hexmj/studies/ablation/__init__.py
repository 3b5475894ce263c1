"""Ablation: what each mechanism or rule buys, at the start, over a walk, in the limit and in physics."""
