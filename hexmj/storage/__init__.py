"""What lies on disk: files written whole or not at all, sealed NetCDF, locks, results and what their numbers share."""
