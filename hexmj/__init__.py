"""hexmj: the 1998 coordination network drives a stick insect, and its stability is measured twice."""
