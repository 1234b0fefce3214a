//! glTF 2.0 and GLB: the only place that knows the format.
