"""Best next-viewpoint recommendation for category-level object pose estimation."""

__version__ = "0.1.0"
