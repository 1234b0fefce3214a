//! Casting: what a ray hits, as geometry defines it.
