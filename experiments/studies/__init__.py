"""One folder per question: measure makes rows, view shows them."""
