"""The paper's experiment: configuration, estimators, evaluation, statistics and report."""
