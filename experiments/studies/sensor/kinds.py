"""Layout of the stored pictures: what making and drawing them both know."""

REDUCED = 8  # of a whole frame, pixels for one of the picture
LARGEST = 2.0  # change by a touch, of the mean intensity, at which the colour scale ends
