"""What the documentation site adds to Sphinx: equations, navigation, and the files it links to."""
