"""A depth frame, cropped to the object as a network sees it."""
