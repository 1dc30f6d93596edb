"""The paper's printed values and claims, and their verdicts on our results."""
