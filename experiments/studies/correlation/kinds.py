"""What is correlated, and how large its pictures are: what measuring and drawing both know."""

KINDS = ("speckle", "hypervector", "prototype")  # Eq. 4, 5, 6
REDUCED = 4  # pictures of a whole frame, in pixels of the frame for one of the picture
