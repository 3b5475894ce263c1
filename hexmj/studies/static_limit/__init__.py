"""The static limit: what becomes of the walking insect as V_p goes to zero."""
