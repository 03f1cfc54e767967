//! The recorded sequence of one run: every contraction with the position and the wedge values it left behind.
//!
//! A cut after `k` contractions is a level. Replaying needs no adjacency: vertices and wedges are forests of merges, a
//! triangle is gone when two of its corners have become one vertex.

use serde::{Deserialize, Serialize};

use crate::mesh::Mesh;
use crate::mesh::layout::Layout;
use crate::mesh::topology::{Contraction, Place, Topology};
use crate::mesh::weld::Weld;
use crate::metric::CostUnit;

/// The sequence. Positions are in object space, wedge values unscaled (as they will be written).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progressive {
    /// Vertices of the welded surface.
    pub vertices: u32,
    /// Wedges of the welded surface.
    pub wedges: u32,
    /// Columns of values recorded for each wedge.
    pub columns: u32,
    /// Triangles at the start, without those that have two corners at one vertex.
    pub triangles: u32,
    /// The contractions in order.
    pub steps: Vec<Step>,
    /// Wedge merges `[stays, gone]` of all steps.
    pub merges: Vec<[u32; 2]>,
    /// Wedges whose values a step set, of all steps.
    pub set_wedges: Vec<u32>,
    /// Their values, `columns` each.
    pub set_values: Vec<f32>,
    /// How far the surface is at most from the source after each step, in the sense of the metric's paper, object space;
    /// empty where the metric makes no such statement.
    pub bounds: Vec<f32>,
}

/// One contraction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Vertex that stays.
    pub kept: u32,
    /// Vertex that is gone.
    pub gone: u32,
    /// Where `kept` is from now on, object space.
    pub position: [f32; 3],
    /// Where that lies along the edge, 0 at `kept` … 1 at `gone`: passive attributes follow.
    pub t: f32,
    /// Cost in units of the object (a length, or its fourth power: [`CostUnit`]): comparable between sub-meshes of one run
    /// of the same metric.
    pub cost: f32,
    /// Triangles left after this step.
    pub triangles: u32,
    /// End of this step's entries in [`Progressive::merges`].
    pub merges_end: u32,
    /// End of this step's entries in [`Progressive::set_wedges`].
    pub set_end: u32,
}

impl Progressive {
    /// Number of steps after which at most `triangles` are left; all of them if that is never so.
    pub fn cut_at(&self, triangles: usize) -> usize {
        if self.triangles as usize <= triangles {
            return 0;
        }
        // Each step leaves no more triangles than the one before it.
        let reached = self.steps.partition_point(|step| triangles < step.triangles as usize);
        (reached + 1).min(self.steps.len())
    }

    /// Triangles left after the first `steps`.
    pub fn triangles_after(&self, steps: usize) -> usize {
        steps.checked_sub(1).map_or(self.triangles, |last| self.steps[last].triangles) as usize
    }

    /// How far the surface is at most from the source after the first `steps`, if the metric says so; object space.
    pub fn bound_after(&self, steps: usize) -> Option<f64> {
        match steps.checked_sub(1) {
            None => (!self.bounds.is_empty()).then_some(0.0),
            Some(last) => self.bounds.get(last).map(|&bound| f64::from(bound)),
        }
    }
}

/// One contraction as it was done, unit frame.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    /// Vertex that stays.
    pub kept: u32,
    /// Vertex that is gone.
    pub gone: u32,
    /// Where the vertex that stays is from now on.
    pub position: [f64; 3],
    /// Where that lies along the edge.
    pub t: f32,
    /// Whether that is one of the ends.
    pub place: Place,
    /// Its price.
    pub cost: f64,
}

/// Writes the sequence while it happens.
#[derive(Debug)]
pub struct Recorder {
    out: Progressive,
    layout: Layout,
    wedge_primitive: Vec<u32>,
    /// `1 / scale` for each column of each primitive; 0 where the primitive lacks the attribute.
    unscale: Vec<f64>,
    columns: usize,
    cost_scale: f64,
    /// Where each vertex is now, object space. Source positions do not pass through the unit frame, which could cost
    /// them their last bit.
    positions: Vec<[f32; 3]>,
}

impl Recorder {
    /// Starts a sequence on an untouched surface.
    pub fn new(mesh: &Mesh, surface: &Topology, layout: &Layout, weld: Weld) -> Self {
        let primitives = weld.stored_start.len();
        let mut unscale = vec![0.0; primitives * layout.columns];
        for field in &layout.fields {
            for (primitive, &scale) in field.scale.iter().enumerate() {
                for c in 0..field.components {
                    let inverse = if scale > 0.0 { 1.0 / scale } else { 0.0 };
                    unscale[primitive * layout.columns + field.offset + c] = inverse;
                }
            }
        }
        let out = Progressive {
            vertices: surface.positions.len() as u32,
            wedges: surface.wedge_vertex.len() as u32,
            columns: layout.columns as u32,
            triangles: surface.alive as u32,
            // What a run needs if most wedges stand alone: growing by doubling would hold everything twice.
            steps: Vec::with_capacity(surface.positions.len()),
            merges: Vec::with_capacity(surface.wedge_vertex.len()),
            set_wedges: Vec::with_capacity(surface.wedge_vertex.len()),
            set_values: Vec::with_capacity(surface.values.len()),
            bounds: Vec::new(),
        };
        let mut positions = vec![[0.0; 3]; weld.vertices];
        for (wedge, &vertex) in weld.wedge_vertex.iter().enumerate() {
            let primitive = &mesh.primitives[weld.wedge_primitive[wedge] as usize];
            positions[vertex as usize] = primitive.positions()[weld.wedge_source[wedge] as usize];
        }
        Self {
            out,
            layout: layout.clone(),
            wedge_primitive: weld.wedge_primitive,
            unscale,
            columns: layout.columns,
            cost_scale: 1.0,
            positions,
        }
    }

    /// What the values are that are recorded.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Primitive of each wedge.
    pub fn wedge_primitive(&self) -> &[u32] {
        &self.wedge_primitive
    }

    /// Says what the costs are that follow.
    pub fn costs_are(&mut self, unit: CostUnit) {
        let squared = self.layout.radius * self.layout.radius;
        self.cost_scale = match unit {
            CostUnit::SquareTimesArea => squared * squared,
            CostUnit::Length => self.layout.radius,
        };
    }

    /// Adds a contraction that has been done in `surface`, with its wedge values set, and the metric's bound if it has one.
    /// `cost` is in the unit frame.
    pub fn add(&mut self, surface: &Topology, done: &Contraction, cost: f64, bound: Option<f64>) {
        if let Some(bound) = bound {
            self.out.bounds.push(above(bound * self.layout.radius));
        }
        let taken = Taken {
            kept: done.kept,
            gone: done.gone,
            position: surface.positions[done.kept as usize],
            t: done.t as f32,
            place: done.place,
            cost,
        };
        let set = surface.wedges(done.kept).map(|wedge| (wedge, surface.value(wedge)));
        self.take(&taken, &done.merged, set, surface.alive);
    }

    /// Adds a contraction that joined the wedges `merged` and gave those of the vertex that stays the values `set`.
    pub fn take<'a>(
        &mut self,
        taken: &Taken,
        merged: &[[u32; 2]],
        set: impl Iterator<Item = (u32, &'a [f32])>,
        triangles: usize,
    ) {
        self.out.merges.extend_from_slice(merged);
        for (wedge, values) in set {
            self.out.set_wedges.push(wedge);
            let unscale = &self.unscale[self.wedge_primitive[wedge as usize] as usize * self.columns..];
            let values = values.iter().zip(&unscale[..self.columns]);
            self.out.set_values.extend(values.map(|(value, unscale)| (f64::from(*value) * unscale) as f32));
        }
        let &Taken { kept, gone, t, .. } = taken;
        let position = match taken.place {
            Place::Kept => self.positions[kept as usize],
            Place::Gone => self.positions[gone as usize],
            Place::New => self.layout.to_object(taken.position),
        };
        self.positions[kept as usize] = position;
        self.out.steps.push(Step {
            kept,
            gone,
            position,
            t,
            cost: (taken.cost * self.cost_scale) as f32,
            triangles: triangles as u32,
            merges_end: self.out.merges.len() as u32,
            set_end: self.out.set_wedges.len() as u32,
        });
    }

    /// The finished sequence.
    pub fn finish(self) -> Progressive {
        self.out
    }
}

/// The least `f32` that is not below `x`.
fn above(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}
