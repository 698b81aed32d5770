"""Cases that numbers break on, one module for each part of the project."""
