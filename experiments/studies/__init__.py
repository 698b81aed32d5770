"""One folder a question: measure makes rows, view shows them."""
