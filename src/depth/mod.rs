//! From disparity to the grid of depths and to distance.
