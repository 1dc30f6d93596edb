"""Real depth frames: from a file in any usual form to the crop that a network sees."""
