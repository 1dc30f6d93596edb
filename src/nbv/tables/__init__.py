"""Tables of any estimator's errors: from its estimates to the next view."""
