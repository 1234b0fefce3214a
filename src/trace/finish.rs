//! The whole hits of rays whose nearest triangle is known: depth, weights, normal and ids, in f64 and four rays side by side,
//! from the leaf that is still in the cache.

use glam::DVec3;

use super::exact::{self, Corners, Facet, LocalRay, Xyz};
use super::lanes::Doubles;
use super::packet::Nearest;
use super::tracer::{Batch, Tracer};
use super::wide::{Block, Slot};
use super::{Hit, Origins};

impl Tracer<'_> {
    /// The whole hits of a batch of at most a packet's rays.
    #[inline(always)]
    pub(super) fn finish_all<D: Doubles>(&self, rays: &Batch, nearest: &Nearest, hits: &mut [Option<Hit>]) {
        let mut last = None;
        for (four, hits) in hits.chunks_mut(4).enumerate() {
            if !self.finish_alike::<D>(rays, nearest, four * 4, hits, &mut last) {
                self.finish_four::<D>(rays, nearest, four * 4, hits);
            }
        }
    }

    /// The whole hits of four rays from number `first` on that all hit the same triangle of placement 0; false if they don't.
    /// `last` is the triangle of the previous ones.
    #[inline(always)]
    fn finish_alike<D: Doubles>(
        &self,
        rays: &Batch,
        nearest: &Nearest,
        first: usize,
        hits: &mut [Option<Hit>],
        last: &mut Option<Seen>,
    ) -> bool {
        let Origins::Common(origin) = rays.origins else { return false };
        let Some(slot) = nearest.all_in(first, 0) else { return false };
        let (Ok(hits), Some(directions)) =
            (<&mut [_; 4]>::try_from(hits), rays.directions.get(first..first + 4))
        else {
            return false;
        };
        let Seen { facet, normal, triangle, .. } = match last {
            Some(seen) if seen.slot == slot => seen,
            _ => {
                let block = Block::at(&self.wide(0).blocks, slot.granule());
                let facet = Facet::new(Corners::from_positions(block.positions(slot.lane()), origin).xyz());
                let Xyz(x, y, z) = facet.normal.normalized();
                last.insert(Seen {
                    slot,
                    facet,
                    normal: DVec3::new(x, y, z),
                    triangle: block.id(slot.lane()),
                })
            }
        };
        let (normal, triangle) = (*normal, *triangle);
        let facet = Facet::<D>::splat(facet);
        let d = Xyz(
            D::load(&[directions[0].x, directions[1].x, directions[2].x, directions[3].x]),
            D::load(&[directions[0].y, directions[1].y, directions[2].y, directions[3].y]),
            D::load(&[directions[0].z, directions[1].z, directions[2].z, directions[3].z]),
        );
        let (t, within) = facet.plane_depth(d);
        if within != 0b1111 {
            return false;
        }
        let (u, v) = facet.weights(d);
        let (mut ts, mut us, mut vs) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        t.store(&mut ts);
        u.store(&mut us);
        v.store(&mut vs);
        for (k, hit) in hits.iter_mut().enumerate() {
            *hit = Some(Hit { t: ts[k], u: us[k], v: vs[k], normal, placement: 0, triangle });
        }
        true
    }

    /// The whole hits of up to four rays from number `first` on: [`Candidate::finish`](exact::Candidate::finish) and the
    /// depth, side by side.
    #[inline(always)]
    fn finish_four<D: Doubles>(
        &self,
        rays: &Batch,
        nearest: &Nearest,
        first: usize,
        hits: &mut [Option<Hit>],
    ) {
        let mut best = [None; 4];
        for (k, best) in best.iter_mut().enumerate().take(hits.len()) {
            *best = nearest.get(first + k);
        }
        let found = [best[0].is_some(), best[1].is_some(), best[2].is_some(), best[3].is_some()];
        let Some(some) = best[0].or(best[1]).or(best[2]).or(best[3]) else {
            hits.fill(None);
            return;
        };
        // Where there is no hit, the same is worked out as elsewhere, and dropped.
        let last = hits.len() - 1;
        let mut corners = [[[0.0_f32; 3]; 3]; 4];
        let mut triangles = [0; 4];
        let mut local = [LocalRay { origin: DVec3::ZERO, direction: DVec3::ZERO }; 4];
        let is_alone = self.top.nodes.is_empty();
        for k in 0..4 {
            let best = *best[k].get_or_insert(some);
            let block = Block::at(&self.wide(best.placement).blocks, best.slot.granule());
            corners[k] = block.positions(best.slot.lane());
            triangles[k] = block.id(best.slot.lane());
            local[k] = rays.ray(first + k.min(last));
            if !is_alone && best.placement != 0 {
                local[k] = local[k].carried(&self.scene.placements[best.placement as usize]);
            }
        }
        let [p, q, r, s] = &local;
        let d = Xyz(
            D::load(&[p.direction.x, q.direction.x, r.direction.x, s.direction.x]),
            D::load(&[p.direction.y, q.direction.y, r.direction.y, s.direction.y]),
            D::load(&[p.direction.z, q.direction.z, r.direction.z, s.direction.z]),
        );
        let origin = match rays.origins {
            Origins::Common(o) if is_alone => Xyz(D::splat(o.x), D::splat(o.y), D::splat(o.z)),
            _ => Xyz(
                D::load(&[p.origin.x, q.origin.x, r.origin.x, s.origin.x]),
                D::load(&[p.origin.y, q.origin.y, r.origin.y, s.origin.y]),
                D::load(&[p.origin.z, q.origin.z, r.origin.z, s.origin.z]),
            ),
        };
        let facet = Facet::new([
            corner::<D>(&corners, 0).sub(origin),
            corner::<D>(&corners, 1).sub(origin),
            corner::<D>(&corners, 2).sub(origin),
        ]);
        let (t, within) = facet.plane_depth(d);
        let (u, v) = facet.weights(d);
        let mut normal = facet.normal;
        if !is_alone {
            let [mut x, mut y, mut z] = store_xyz(normal);
            for k in 0..4 {
                let placement = &self.scene.placements[best[k].unwrap_or(some).placement as usize];
                Xyz(x[k], y[k], z[k]) = exact::out_of(placement, Xyz(x[k], y[k], z[k]));
            }
            normal = Xyz(D::load(&x), D::load(&y), D::load(&z));
        }
        let [nx, ny, nz] = store_xyz(normal.normalized());
        let (mut ts, mut us, mut vs) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        t.store(&mut ts);
        u.store(&mut us);
        v.store(&mut vs);
        for (k, hit) in hits.iter_mut().enumerate() {
            if !found[k] {
                *hit = None;
                continue;
            }
            if within >> k & 1 == 0 {
                ts[k] = Corners::from_positions(corners[k], local[k].origin).depth(local[k].direction);
            }
            *hit = Some(Hit {
                t: ts[k],
                u: us[k],
                v: vs[k],
                normal: DVec3::new(nx[k], ny[k], nz[k]),
                placement: best[k].unwrap_or(some).placement,
                triangle: triangles[k],
            });
        }
    }
}

/// A triangle of placement 0, as the last rays that hit it needed it.
struct Seen {
    slot: Slot,
    facet: Facet<f64>,
    normal: DVec3,
    triangle: u32,
}

/// A corner of four triangles.
#[inline(always)]
fn corner<D: Doubles>([p, q, r, s]: &[[[f32; 3]; 3]; 4], c: usize) -> Xyz<D> {
    Xyz(
        D::from_f32([p[c][0], q[c][0], r[c][0], s[c][0]]),
        D::from_f32([p[c][1], q[c][1], r[c][1], s[c][1]]),
        D::from_f32([p[c][2], q[c][2], r[c][2], s[c][2]]),
    )
}

#[inline(always)]
fn store_xyz<D: Doubles>(x: Xyz<D>) -> [[f64; 4]; 3] {
    let mut to = [[0.0; 4]; 3];
    x.0.store(&mut to[0]);
    x.1.store(&mut to[1]);
    x.2.store(&mut to[2]);
    to
}
