"""The insect in MuJoCo: plan in, measured walk out."""
