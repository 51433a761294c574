//! Hot loops: one readable implementation compiled per instruction set and chosen at run time.
