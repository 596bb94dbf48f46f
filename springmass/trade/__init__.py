"""What accuracy costs: estimators against each other on simulated records, or on one of the user's own."""
