"""Opinion scores as in ITU-T P.910: means with intervals, and the biases of those who gave them."""
