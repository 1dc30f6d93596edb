"""From an estimator's held-out errors to densities on the torus of estimate and viewpoint."""
