//! Casting: the hits of rays as geometry defines them, independent of how a traversal finds them.
//!
//! A ray passes through a triangle when the signs of three determinants say so in exact arithmetic, edges and vertices
//! included, so a closed mesh cannot leak. The hit is the least depth within the ray's limits, and equal depths go to the lowest
//! triangle id. The code of [`exact`] is the whole definition. [`BruteForce`] applies it to every triangle, and [`Tracer`] finds the
//! same hits, bit for bit, with bounding volume hierarchies. [`AnyTracer`] casts with it or, for comparison, with one of the
//! published [`methods`].
//!
//! ```text
//! exact        the definition; dyadic: its arithmetic; adversary: inputs that are hard for it
//! brute        every triangle, by the definition
//! tracer       the hierarchies of a scene: top, over its placements, and bvh/, over a mesh
//! packet/      neighbouring rays together; policy: how many of them
//! single       rays alone; stream: many of them in turns; scalar: in f64
//! simd/        eight lanes: portable, AVX2, AVX-512; rounding: the constants of f32 bounds
//! rays batch   rays and hits as callers and as traversals have them; hit_attributes: what a hit's triangle tells
//! methods/     the published methods; any: the tracer that a job casts with
//! all_hits     all hits of rays, one after the other
//! placements   packets and rays among placements; moving: among those that move; maps: where these are at the times of rays
//! scratch      the memory of casting; stats: counters of its work
//! ```
//!
//! Rays come in batches of neighbours, such as a tile of an image or the beams of a firing. They are fast if they share an origin.
//! Where things move, each ray has a time ([`Rays::times_s`]), and finds them where they are then.
//! Where one ray has several hits to give (cut-outs, glass, further returns), [`Rays::after`] asks for the next one, and
//! [`all_hits()`] for all.

#[cfg(test)]
mod adversary;
mod all_hits;
mod any;
mod batch;
mod brute;
mod bvh;
mod dyadic;
pub mod exact;
mod hit_attributes;
mod maps;
pub mod methods;
mod moving;
mod packet;
mod placements;
mod policy;
mod rays;
mod rounding;
mod scalar;
mod scratch;
mod simd;
mod single;
mod stats;
mod stream;
mod top;
mod tracer;

pub use all_hits::all_hits;
pub use any::AnyTracer;
pub use batch::PACKET_RAYS;
pub use brute::BruteForce;
pub use rays::{Cast, Hit, Origins, Rays};
pub use stats::TraversalStats;
pub use tracer::{Instructions, Tracer};
